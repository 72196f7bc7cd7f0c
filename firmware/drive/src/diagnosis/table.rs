//! States, warnings and errors of the drive in plain words: S-0-0095 (text) and S-0-0390 (number), with cause and remedy for
//! P-0-0010, P-0-0011 and the manual. One table for all of them.

use sercos::diagnostic::{Class1, Class2};
use sercos::phase::{InterfaceStatus, PhaseError};

use super::words::{Circumstances, Manufacturer1, Manufacturer2, Manufacturer3};
use crate::state::DriveState;

/// One diagnosis. Numbers A0xxH are states, E0xxH warnings, F0xxH errors of communication, F1xxH errors of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Diagnosis {
    /// S-0-0390.
    pub number: u16,
    /// S-0-0095 in English, at most 40 characters.
    pub text: &'static str,
    /// S-0-0095 in German (S-0-0265 = 0), at most 40 characters, in ASCII.
    pub german: &'static str,
    /// What leads to it (P-0-0010).
    pub cause: &'static str,
    /// What to do about it; empty for a state that needs nothing (P-0-0011).
    pub remedy: &'static str,
}

/// What kind a diagnosis is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Severity {
    /// Nothing is wrong.
    State,
    /// The drive goes on (C2D).
    Warning,
    /// The drive has shut down (C1D).
    Error,
}

impl Diagnosis {
    /// State, warning or error.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self.number >> 12 {
            0xF => Severity::Error,
            0xE => Severity::Warning,
            _ => Severity::State,
        }
    }
}

macro_rules! diagnoses {
    ($($name:ident = $number:literal $text:literal, $german:literal, $cause:literal, $remedy:literal;)+) => {
        $(pub(crate) const $name: Diagnosis = Diagnosis {
            number: $number,
            text: $text,
            german: $german,
            cause: $cause,
            remedy: $remedy,
        };)+

        /// Every diagnosis, in ascending order of its number.
        pub static DIAGNOSES: &[Diagnosis] = &[$($name),+];
    };
}

diagnoses! {
    PHASE_0 = 0xA000 "Communication phase 0", "Kommunikationsphase 0",
        "The master closes the ring.", "";
    PHASE_1 = 0xA001 "Communication phase 1", "Kommunikationsphase 1",
        "The master looks for its drives.", "";
    PHASE_2 = 0xA002 "Communication phase 2", "Kommunikationsphase 2",
        "The master sets parameters.", "";
    PHASE_3 = 0xA003 "Communication phase 3", "Kommunikationsphase 3",
        "Cyclic telegrams run, commands are not valid yet.", "";
    NO_POWER = 0xA010 "Ready for main power", "Bereit zur Leistungszuschaltung",
        "The logic is ready; the DC link is not charged.", "Switch the main power on.";
    READY = 0xA011 "Power applied, torque-free", "Leistung an, drehmomentfrei",
        "The drive waits for bits 15 and 14 of the control word.", "";
    FOLLOWING = 0xA012 "In operation, following commands", "In Betrieb, folgt den Sollwerten",
        "Torque is on and the command values are followed.", "";
    HALTED = 0xA013 "Drive halt", "Antrieb Halt",
        "Bit 13 of the control word is 0.", "";
    SWITCHING_OFF = 0xA014 "Stopping", "Stillsetzen",
        "Bit 15 of the control word went to 0, or the master left CP4.", "";
    PARKED = 0xA015 "Axis parked", "Achse geparkt",
        "S-0-0139 has taken the axis out: no torque until it is cancelled or the next run-up passes CP2.", "";
    HOMING = 0xA016 "Homing command active", "Referenzfahrt aktiv",
        "S-0-0148 has set the reference; the drive holds its position until the command is cancelled.",
        "Align S-0-0047 with S-0-0051, then cancel S-0-0148.";
    SWITCHING_ON = 0xA017 "Switching on", "Einschalten",
        "The torque is being proven, the commutation angle searched or the brake opened; commands are not followed yet.", "";
    ENGAGING = 0xA018 "Closing the brake", "Bremse schliesst",
        "The axis stands; the brake closes, then the torque goes.", "";
    TELEGRAM_LOST = 0xE001 "Telegram lost", "Telegramm verloren",
        "An MST or an MDT was lost within the last second; two in a row would have been an error. S-0-0028 and S-0-0029 count them.",
        "Check fibres and plugs for attenuation, and the supply of the stations before this one.";
    NOT_LOCKED = 0xE002 "Loops not locked to the ring", "Regelung nicht synchron zum Ring",
        "The MSTs come too irregularly, or S-0-0002 is not the time between them.",
        "Check the master's cycle and its jitter against S-0-0002.";
    AMPLIFIER_NOT_READY = 0xE003 "Amplifier reports a fault", "Leistungsteil meldet Fehler",
        "The amplifier reports a fault while torque is off.",
        "Read the amplifier's own display and clear its fault before switching on.";
    NOT_CALIBRATED = 0xE004 "Current sensors without zero", "Stromsensoren ohne Nullpunkt",
        "The current sensors show more than 5 % of their range without current.",
        "Check the supply and the wires of the current sensors.";
    LIMIT_OUT_OF_RANGE = 0xE005 "Limit in the MDT out of range", "Grenzwert im MDT ungueltig",
        "A limit in the MDT is not within its minimum and maximum and counts as the nearer of them, or its ramp cannot be made and the one before stays.",
        "Check the values that the control sends for the limits of S-0-0024 against elements 5 and 6.";
    LINK_FULL = 0xE006 "DC link full, braking limited", "Zwischenkreis voll, Bremsen begrenzt",
        "The DC link is above 93 % of P-0-0105 (96 % with a brake chopper), and less current may flow back into it: a stop takes longer.",
        "Fit a brake chopper (P-0-0235) or a smaller resistor, brake more gently (S-0-0138), check the mains voltage against P-0-0105.";
    CHOPPER_HOT = 0xE007 "Chopper resistor hot", "Bremswiderstand heiss",
        "The thermal model of the chopper's resistor has passed 90 % (P-0-0238); at 100 % it is switched off.",
        "Brake less often or more gently, fit a larger resistor; check P-0-0235 to P-0-0237 against its data sheet.";
    CHOPPER_OFF = 0xE008 "Chopper off, resistor too hot", "Chopper aus, Widerstand zu heiss",
        "The chopper's resistor has passed 100 % of its load (P-0-0238) and is off until it is below 80 %: a stop takes longer.",
        "Let it cool down; check the mains voltage against P-0-0105, P-0-0235 to P-0-0237 against its data sheet, and how often the axis brakes.";
    NO_POWER_AT_SWITCH_ON = 0xE009 "Switched on without main power", "Freigabe ohne Leistung",
        "Bits 15 and 14 of the control word are set, but the DC link is not charged.",
        "Switch the main power on, then give bit 15 a new edge.";
    SAVE_CUT = 0xE00A "Last save cut, set before it loaded", "Speichern abgebrochen, alter Satz gilt",
        "The supply went while parameters were being saved; the control was not told that it was done. The set before is in force.",
        "Check the parameters and save them again (S-0-0264).";
    AMPLIFIER_UNKNOWN = 0xE00B "Amplifier unknown, no CP4", "Leistungsteil unbekannt, kein CP4",
        "The production record cannot be read or cannot be true, or the parameters were saved of another amplifier (P-0-0014). The brake resistor is off.",
        "Give S-0-0128 and read P-0-0003. Write the record (cargo xtask identity), or say by S-0-0264 that the ratings shown are right.";
    OVERLOAD_WARNING = 0xE010 "Overload, current reduced", "Ueberlast, Strom begrenzt",
        "The thermal model of motor or amplifier has passed 90 % (P-0-0132, P-0-0133); the current is folded back.",
        "Reduce load or cycle; check friction, brake, S-0-0111, P-0-0130, and the amplifier's size S-0-0112.";
    HEAT_SINK_WARNING = 0xE011 "Amplifier hot", "Leistungsteil heiss",
        "The heat sink has passed S-0-0200.", "Check cooling and ambient temperature; reduce the load.";
    WINDING_WARNING = 0xE012 "Motor hot", "Motor heiss",
        "The motor has passed S-0-0201.", "Check the motor's cooling; reduce the load.";
    VELOCITY_DEVIATION = 0xE013 "Excessive velocity deviation", "Drehzahlabweichung zu gross",
        "The velocity differs from its command by more than S-0-0377.",
        "Check load, torque limit S-0-0092 and the gains S-0-0100 and S-0-0101.";
    LIGHT_LOSS = 0xF001 "No light: MST and MDT missing", "Kein Licht: MST und MDT fehlen",
        "Two MSTs and two MDTs in a row were not received.",
        "Check fibres, plugs and the supply of the station before this one.";
    MST_FAILURE = 0xF003 "Two MSTs missing", "Zwei MST fehlen",
        "Two master synchronisation telegrams in a row were missing or not in time.",
        "Check the fibres, the bit rate, and the cycle time S-0-0002 against the master.";
    MDT_FAILURE = 0xF004 "Two MDTs missing", "Zwei MDT fehlen",
        "Two master data telegrams in a row were missing, damaged or not in time.",
        "Check the fibres, and S-0-0089 and S-0-0010 against the master.";
    INVALID_PHASE = 0xF005 "Invalid communication phase", "Ungueltige Kommunikationsphase",
        "An MST announced a phase above 4.",
        "Check the master; check the fibres for attenuation and distortion.";
    UPSHIFT = 0xF006 "Phase skipped upwards", "Phase beim Hochlauf uebersprungen",
        "The master left out a communication phase.",
        "Run up again; check the master's configuration.";
    DOWNSHIFT = 0xF007 "Phase step back, not to 0", "Phasenruecksprung nicht auf 0",
        "The master went back to a phase other than 0.", "Run up again from CP0.";
    NOT_READY = 0xF008 "Phase switch without transition check", "Phasenwechsel ohne Umschaltpruefung",
        "CP3 or CP4 came without a positive S-0-0127 or S-0-0128.",
        "Read S-0-0021 or S-0-0022 and P-0-0003, and correct the data blocks listed there.";
    UNINITIALISED_MODE = 0xF009 "Operation mode not initialised", "Betriebsart nicht initialisiert",
        "Control word bits 11, 9, 8 ask for a mode that S-0-0032 to S-0-0035 and S-0-0284 to S-0-0287 do not set; S-0-0023 names it.",
        "Correct the control word and give S-0-0099, or set the mode in CP2 or CP3.";
    OVERLOAD = 0xF100 "Overload", "Ueberlast",
        "The thermal model of the motor has passed S-0-0114, or that of the amplifier 110 %.",
        "Let it cool down; reduce load or cycle; check S-0-0111, P-0-0130, and the amplifier's size S-0-0112.";
    HEAT_SINK_TEMPERATURE = 0xF101 "Amplifier too hot", "Leistungsteil zu heiss",
        "The heat sink has reached S-0-0203.", "Check cooling and ambient temperature, let it cool by 5 K, then S-0-0099.";
    WINDING_TEMPERATURE = 0xF102 "Motor too hot", "Motor zu heiss",
        "The motor has reached S-0-0204. With P-0-0134 = 4 or 5: its PTC or switch says so, or a wire of it is broken.",
        "Check the motor's cooling and load, let it cool by 5 K, then S-0-0099. PTC or switch: check its wires, too.";
    ENCODER = 0xF105 "Encoder error", "Geberfehler",
        "The encoder's signal stopped, jumped or stands while the rotor turns (its flux tells), or its index does not fit the count. Not told: a dead encoder while the rotor is held.",
        "Check the encoder's cable, shield and supply, S-0-0116; a wrong index also P-0-0117; lost at standstill also P-0-0114.";
    COMMUTATION = 0xF106 "Commutation angle not found", "Kommutierungswinkel nicht gefunden",
        "The search for the commutation angle failed, does not fit the index, or the brake forbids it.",
        "Read S-0-0129; check motor phases, P-0-0110, P-0-0115 and P-0-0116; for an axis with brake P-0-0120 and P-0-0118.";
    OVERCURRENT = 0xF107 "Overcurrent", "Ueberstrom",
        "A phase current passed 168 % of the smaller of S-0-0109 and S-0-0110, or P-0-0106 if that is less.",
        "Check motor cable and winding for a short circuit, then the gains S-0-0106, S-0-0107 and the motor data P-0-0111 to 0114.";
    OVERVOLTAGE = 0xF108 "Overvoltage", "Ueberspannung",
        "The bus voltage passed P-0-0105: mains too high, a hanging load lowered for longer than the link takes it, or magnets that charge the link by themselves.",
        "Check the mains voltage, fit or check a brake chopper (P-0-0235 to P-0-0238), and S-0-0113 against P-0-0239.";
    MAIN_POWER_LOST = 0xF109 "Main power lost", "Leistung ausgefallen",
        "The main power went away while torque was on. The axis was stopped out of the DC link; below P-0-0104 the torque went.",
        "Check mains, contactor and the wire of the main-power input; then S-0-0099.";
    EXCESSIVE_DEVIATION = 0xF10B "Excessive following distance", "Schleppabstand zu gross",
        "The position was further from the command than S-0-0159 allows, or the command was, where following was to begin.",
        "Check for a blocked axis, torque limit S-0-0092 and gains; align S-0-0047 with S-0-0051 before following begins.";
    COMMUNICATION = 0xF10C "Communication error", "Kommunikationsfehler",
        "The ring failed in CP3 or CP4, or the master broke the order of phases; S-0-0014 says which.",
        "Run up again from CP0, then S-0-0099.";
    POSITION_LIMIT = 0xF10D "Position limit passed", "Positionsgrenze ueberschritten",
        "The position, or its command, is beyond S-0-0049 or S-0-0050.",
        "Move back within the limits: clear bit 4 of S-0-0055 in CP3, or correct the limits.";
    AMPLIFIER_FAULT = 0xF10F "Amplifier fault", "Fehler im Leistungsteil",
        "The gate drivers reported a fault, and the break input switched the bridge off while torque was on.",
        "Check motor cable and bridge for a short circuit, and the supply of the gate drivers; then S-0-0099.";
    CURRENT_SENSOR = 0xF110 "Phase currents implausible", "Strangstroeme unglaubwuerdig",
        "The three phase currents do not add up to zero, or do not follow all the voltage there is: a sensor, an earth fault or an open cable.",
        "Check the motor cable for an earth fault and open cores, then the current sensors.";
    DEADLINE = 0xF111 "Current loop too late", "Stromregler zu spaet",
        "The current loop missed two periods in a row; P-0-0153 counts them.",
        "Report it with the firmware's version: this must not happen.";
    BRAKE = 0xF112 "Holding brake", "Haltebremse",
        "The torque could not be proven, or the brake does not open, close or hold.",
        "Check the brake, its supply and contact, S-0-0206, S-0-0207 and P-0-0120 to P-0-0123.";
    SAFE_TORQUE_OFF = 0xF113 "Safe torque off", "Sicher abgeschaltetes Moment",
        "Safe torque off took the torque away while the axis was in operation.",
        "Close the safety circuit, then S-0-0099; stop the axis first next time.";
    SAFE_TORQUE_CHANNELS = 0xF114 "Safe torque off: channels differ", "STO-Kanaele verschieden",
        "The two channels of safe torque off have contradicted each other for more than 100 ms.",
        "Check wiring and relays of both channels. Have the safety circuit looked at before going on.";
    OVERSPEED = 0xF115 "Overspeed", "Ueberdrehzahl",
        "The motor turned faster than 125 % of S-0-0113.",
        "Check the gains, the torque command in mode 1, and what drives the axis from outside.";
    SYNCHRONISATION = 0xF116 "Loops lost the ring's rhythm", "Synchronisation verloren",
        "The loops lost their phase to the MST while the axis was in operation; P-0-0151 and P-0-0152 show how far.",
        "Check the master's cycle and its jitter against S-0-0002.";
    THERMOMETER_BROKEN = 0xF117 "Temperature sensor: wire broken", "Temperatursensor: Drahtbruch",
        "A sensor is not connected, or a wire of it is broken: that of the heat sink where S-0-0384 shows -200.0, else that of the motor, which may also be another one than P-0-0134 says.",
        "Motor: check plug and cores of its sensor, and P-0-0134 (0: it has none); then S-0-0099. Heat sink: have the amplifier repaired.";
    ALIGNMENT_NO_MOVEMENT = 0xF118 "Alignment: motor does not move", "Kommutierung: Motor steht",
        "The motor does not move under the alignment current P-0-0116.",
        "Check that axis and brake are free, motor and encoder are connected; raise P-0-0116.";
    ALIGNMENT_DIRECTION = 0xF119 "Alignment: encoder counts backwards", "Kommutierung: Geber zaehlt falsch",
        "Encoder and motor phases turn against each other.",
        "Swap two motor phases, or turn bit 3 of S-0-0277.";
    ALIGNMENT = 0xF11A "Alignment failed", "Kommutierung fehlgeschlagen",
        "The commutation angle did not settle, or the axis was moved from outside.",
        "Let the axis rest during the first switching-on; change P-0-0116.";
    COMMAND_JUMP = 0xF11B "Position command jumped", "Lagesollwert springt",
        "S-0-0047 with S-0-0048 stepped further than S-0-0091 and a quarter more make in a cycle S-0-0001.",
        "Check the control's path and its cycle against S-0-0001, S-0-0091, and the position scaling; then S-0-0099.";
    OPEN_PHASE = 0xF11C "Motor phase open", "Motorstrang offen",
        "One of the three motor phases carries nothing of the current that is asked of it, and the other two do.",
        "Check motor cable, connectors and motor contactor, all three cores; then S-0-0099.";
    MEMORY = 0xF11D "No saved parameters", "Keine gespeicherten Parameter",
        "Nothing was ever saved (S-0-0264), or what was saved cannot be read any more. All parameters are their defaults, which are no motor of yours.",
        "Write the parameters of motor and axis, or load a backup; S-0-0264, then S-0-0099. If it comes again after S-0-0264, have the board replaced.";
    THERMOMETER_SHORT = 0xF11E "Temperature sensor: short circuit", "Temperatursensor: Kurzschluss",
        "The wires of a sensor touch each other: that of the heat sink where S-0-0384 shows -200.0, else that of the motor, which may also be another one than P-0-0134 says.",
        "Motor: check the cores of its sensor for a short circuit, and P-0-0134 against the motor; then S-0-0099. Heat sink: have the amplifier repaired.";
    FIRMWARE_FAULT = 0xF120 "Firmware fault, restarted", "Firmwarefehler, neu gestartet",
        "The processor met an instruction, an address or an interrupt that the program must not have.",
        "Run up again. Report P-0-0012 and P-0-0013 with the firmware's version: this must not happen.";
    FIRMWARE_PANIC = 0xF121 "Firmware panic, restarted", "Firmware-Abbruch, neu gestartet",
        "The program found something that it rules out; P-0-0012 names file and line.",
        "Run up again. Report P-0-0012 and P-0-0013 with the firmware's version: this must not happen.";
    STACK_OVERFLOW = 0xF122 "Stack overflow, restarted", "Stapelueberlauf, neu gestartet",
        "The stack reached its guard; nothing was overwritten.",
        "Run up again. Report P-0-0012 and P-0-0013 with the firmware's version: this must not happen.";
    CLOCK_FAILED = 0xF123 "Crystal failed, restarted", "Quarz ausgefallen, neu gestartet",
        "The crystal stopped; the hardware switched the bridge off. The drive starts again when the crystal does.",
        "Have the board's crystal replaced; look for moisture, shock and strong fields near it.";
    WATCHDOG_RESET = 0xF124 "Watchdog, restarted", "Watchdog, neu gestartet",
        "A task did not end, did not begin or fell silent; P-0-0012 says what is known.",
        "Run up again. Report P-0-0012 and P-0-0013 with the firmware's version: this must not happen.";
    CONTROL_STOPPED = 0xF125 "Control loop stopped, restarted", "Regelung blieb stehen, neu gestartet",
        "Current loop or control loop did not run for a millisecond; P-0-0012 names the task that ran instead.",
        "Run up again. Report P-0-0012 and P-0-0013 with the firmware's version: this must not happen.";
}

const PHASES: [&Diagnosis; 4] = [&PHASE_0, &PHASE_1, &PHASE_2, &PHASE_3];

/// The errors of the drive, the gravest first.
static ERRORS: [(Class1, &Diagnosis); 12] = [
    (Class1::OVERCURRENT, &OVERCURRENT),
    (Class1::OVERVOLTAGE, &OVERVOLTAGE),
    (Class1::FEEDBACK, &ENCODER),
    (Class1::COMMUTATION, &COMMUTATION),
    (Class1::UNDERVOLTAGE, &MAIN_POWER_LOST),
    (Class1::OVERLOAD, &OVERLOAD),
    (Class1::AMPLIFIER_TEMPERATURE, &HEAT_SINK_TEMPERATURE),
    (Class1::MOTOR_TEMPERATURE, &WINDING_TEMPERATURE),
    (Class1::POSITION_LIMIT, &POSITION_LIMIT),
    (Class1::EXCESSIVE_DEVIATION, &EXCESSIVE_DEVIATION),
    (Class1::COMMUNICATION, &COMMUNICATION),
    // Only where no bit of S-0-0129 says more.
    (Class1::MANUFACTURER, &AMPLIFIER_FAULT),
];

/// The errors of S-0-0129, the gravest first. They stand before those of C1D: they say more.
static OWN_ERRORS: [(Manufacturer1, &Diagnosis); 16] = [
    (Manufacturer1::AMPLIFIER_FAULT, &AMPLIFIER_FAULT),
    // An open phase makes the currents wrong for many reasons.
    (Manufacturer1::OPEN_PHASE, &OPEN_PHASE),
    (Manufacturer1::CURRENT_SENSOR, &CURRENT_SENSOR),
    (Manufacturer1::DEADLINE, &DEADLINE),
    (Manufacturer1::SAFE_TORQUE_CHANNELS, &SAFE_TORQUE_CHANNELS),
    (Manufacturer1::SAFE_TORQUE_OFF, &SAFE_TORQUE_OFF),
    (Manufacturer1::BRAKE, &BRAKE),
    (Manufacturer1::OVERSPEED, &OVERSPEED),
    (Manufacturer1::SYNCHRONISATION, &SYNCHRONISATION),
    (Manufacturer1::ALIGNMENT_NO_MOVEMENT, &ALIGNMENT_NO_MOVEMENT),
    (Manufacturer1::ALIGNMENT_DIRECTION, &ALIGNMENT_DIRECTION),
    (Manufacturer1::ALIGNMENT, &ALIGNMENT),
    (Manufacturer1::THERMOMETER_SHORT, &THERMOMETER_SHORT),
    (Manufacturer1::THERMOMETER_BROKEN, &THERMOMETER_BROKEN),
    (Manufacturer1::COMMAND_JUMP, &COMMAND_JUMP),
    (Manufacturer1::MEMORY, &MEMORY),
];

/// S-0-0390 of a drive with nothing saved, for its tools.
pub const NO_SAVED_PARAMETERS: u16 = MEMORY.number;

/// The diagnosis to show: an error before a warning before a state, the cause of a communication error before the fact.
#[must_use]
pub fn diagnose(now: &Circumstances) -> &'static Diagnosis {
    let only_communication = now.class_1 == Class1::COMMUNICATION || now.class_1.is_empty();
    let of_communication = if only_communication { communication_error(now.interface) } else { None };
    let of_drive = drive_errors(now.class_1, now.manufacturer_1).next();
    let of_drive = of_drive.or_else(|| now.class_1.contains(Class1::COMMUNICATION).then_some(&COMMUNICATION));
    of_communication.or(of_drive).or_else(|| warning(now)).unwrap_or_else(|| state(now))
}

/// The diagnosis of an error that makes the slave fall back to CP0.
#[must_use]
pub const fn of_phase_error(error: PhaseError) -> &'static Diagnosis {
    match error {
        PhaseError::MstFailure => &MST_FAILURE,
        PhaseError::MdtFailure => &MDT_FAILURE,
        PhaseError::LightLoss => &LIGHT_LOSS,
        PhaseError::InvalidPhase { .. } => &INVALID_PHASE,
        PhaseError::Upshift { .. } => &UPSHIFT,
        PhaseError::Downshift { .. } => &DOWNSHIFT,
        PhaseError::NotReady { .. } => &NOT_READY,
        PhaseError::UninitialisedMode { .. } => &UNINITIALISED_MODE,
    }
}

/// The diagnoses of the drive's own errors among some bits of C1D and of S-0-0129; the phase machine tells those of communication.
pub(crate) fn drive_errors(class_1: Class1, own: Manufacturer1) -> impl Iterator<Item = &'static Diagnosis> {
    // A search that failed sets both: its own bit says why.
    let explained = if own.intersects(Manufacturer1::ALIGNMENTS) { Class1::COMMUTATION } else { Class1::empty() };
    let explained = if own.is_empty() { explained } else { explained | Class1::MANUFACTURER };
    let class_1 = class_1.difference(Class1::COMMUNICATION | explained);
    let special = OWN_ERRORS.iter().filter(move |(bit, _)| own.contains(*bit)).map(|(_, diagnosis)| *diagnosis);
    let general = ERRORS.iter().filter(move |(bit, _)| class_1.contains(*bit)).map(|(_, diagnosis)| *diagnosis);
    special.chain(general)
}

fn communication_error(interface: InterfaceStatus) -> Option<&'static Diagnosis> {
    let errors: [(bool, &'static Diagnosis); 8] = [
        (interface.mst_failure() && interface.mdt_failure(), &LIGHT_LOSS),
        (interface.mst_failure(), &MST_FAILURE),
        (interface.mdt_failure(), &MDT_FAILURE),
        (interface.invalid_phase(), &INVALID_PHASE),
        (interface.upshift(), &UPSHIFT),
        (interface.downshift(), &DOWNSHIFT),
        (interface.not_ready(), &NOT_READY),
        (interface.uninitialised_mode(), &UNINITIALISED_MODE),
    ];
    errors.into_iter().find(|(present, _)| *present).map(|(_, diagnosis)| diagnosis)
}

fn warning(now: &Circumstances) -> Option<&'static Diagnosis> {
    let own = now.manufacturer_2;
    let warnings: [(bool, &'static Diagnosis); 14] = [
        (own.contains(Manufacturer2::AMPLIFIER_UNKNOWN), &AMPLIFIER_UNKNOWN),
        (own.contains(Manufacturer2::AMPLIFIER_NOT_READY), &AMPLIFIER_NOT_READY),
        (own.contains(Manufacturer2::NOT_CALIBRATED), &NOT_CALIBRATED),
        (now.class_2.contains(Class2::OVERLOAD), &OVERLOAD_WARNING),
        (now.class_2.contains(Class2::AMPLIFIER_TEMPERATURE), &HEAT_SINK_WARNING),
        (now.class_2.contains(Class2::MOTOR_TEMPERATURE), &WINDING_WARNING),
        (now.class_2.contains(Class2::UNDERVOLTAGE), &NO_POWER_AT_SWITCH_ON),
        (now.class_2.contains(Class2::VELOCITY_DEVIATION), &VELOCITY_DEVIATION),
        (own.contains(Manufacturer2::CHOPPER_OFF), &CHOPPER_OFF),
        (own.contains(Manufacturer2::CHOPPER_HOT), &CHOPPER_HOT),
        (own.contains(Manufacturer2::LINK_FULL), &LINK_FULL),
        (own.contains(Manufacturer2::LIMIT_OUT_OF_RANGE), &LIMIT_OUT_OF_RANGE),
        (own.contains(Manufacturer2::TELEGRAM_LOST), &TELEGRAM_LOST),
        (own.contains(Manufacturer2::NOT_LOCKED), &NOT_LOCKED),
    ];
    warnings.into_iter().find(|(present, _)| *present).map(|(_, diagnosis)| diagnosis)
}

fn state(now: &Circumstances) -> &'static Diagnosis {
    match now.state {
        DriveState::Following => &FOLLOWING,
        DriveState::Halted if now.homing => &HOMING,
        DriveState::Halted => &HALTED,
        DriveState::SwitchingOff => &SWITCHING_OFF,
        DriveState::SwitchingOn => &SWITCHING_ON,
        DriveState::Engaging => &ENGAGING,
        _ => match PHASES.get(usize::from(now.phase.number())) {
            Some(diagnosis) => diagnosis,
            None if now.manufacturer_3.contains(Manufacturer3::PARKED) => &PARKED,
            None if now.power => &READY,
            None => &NO_POWER,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crash::CrashCause;
    use sercos::Phase;

    #[test]
    fn numbers_ascend_and_every_text_fits_and_says_something() {
        assert!(DIAGNOSES.windows(2).all(|pair| pair[0].number < pair[1].number));
        for diagnosis in DIAGNOSES {
            let number = diagnosis.number;
            for text in [diagnosis.text, diagnosis.german] {
                assert!(!text.is_empty() && text.len() <= 40 && text.is_ascii(), "{number:04X}H: {text}");
            }
            assert!(diagnosis.cause.ends_with('.') && diagnosis.cause.is_ascii(), "{number:04X}H");
            let needs_help = diagnosis.severity() != Severity::State;
            assert!(!needs_help || diagnosis.remedy.ends_with('.'), "{number:04X}H has no remedy");
        }
    }

    #[test]
    fn every_error_that_can_be_shown_is_in_the_table() {
        let own = OWN_ERRORS.iter().map(|(_, diagnosis)| *diagnosis);
        let shown = ERRORS.iter().map(|(_, diagnosis)| *diagnosis).chain(own);
        let of_phases = [
            PhaseError::MstFailure,
            PhaseError::MdtFailure,
            PhaseError::LightLoss,
            PhaseError::InvalidPhase { received: 5 },
            PhaseError::Upshift { from: Phase::Cp0, to: Phase::Cp2 },
            PhaseError::Downshift { from: Phase::Cp2, to: Phase::Cp1 },
            PhaseError::NotReady { to: Phase::Cp3 },
            PhaseError::UninitialisedMode { selected: 3 },
        ];
        let of_crashes = [
            CrashCause::Fault,
            CrashCause::Panic,
            CrashCause::StackOverflow,
            CrashCause::Clock,
            CrashCause::Unbound,
            CrashCause::Watchdog,
            CrashCause::ControlStopped,
        ];
        let errors = shown.chain(of_phases.into_iter().map(of_phase_error));
        let errors = errors.chain(of_crashes.into_iter().map(CrashCause::diagnosis));
        let errors: std::collections::BTreeSet<u16> = errors.map(|diagnosis| diagnosis.number).collect();
        let table = DIAGNOSES.iter().filter(|diagnosis| diagnosis.severity() == Severity::Error);
        assert_eq!(errors, table.map(|diagnosis| diagnosis.number).collect());
    }

    #[test]
    fn the_bits_of_s_0_0014_and_the_phase_errors_lead_to_the_same_diagnosis() {
        for (bit, error) in [
            (3, PhaseError::MstFailure),
            (4, PhaseError::MdtFailure),
            (5, PhaseError::InvalidPhase { received: 5 }),
            (6, PhaseError::Upshift { from: Phase::Cp0, to: Phase::Cp2 }),
            (7, PhaseError::Downshift { from: Phase::Cp2, to: Phase::Cp1 }),
            (8, PhaseError::NotReady { to: Phase::Cp3 }),
            (9, PhaseError::UninitialisedMode { selected: 3 }),
        ] {
            let interface = InterfaceStatus::new_with_raw_value(1 << bit);
            assert_eq!(communication_error(interface), Some(of_phase_error(error)), "bit {bit}");
        }
        let both = InterfaceStatus::new_with_raw_value(0b1_1000);
        assert_eq!(communication_error(both), Some(&LIGHT_LOSS));
    }
}
