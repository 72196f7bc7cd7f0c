//! The observer of one drive: it hears the fibre, sees the axis, and asks the laws.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use plant::MachineSettings;
use ring::ident::{Element, Idn};
use ring::wire::LineError;
use ring::{Nanoseconds, Tap};

use crate::broken::Broken;
use crate::dialogue::{Dialogue, Heard};
use crate::law::{Coverage, Event, Law, Verdict};
use crate::laws;
use crate::scene::Scene;
use crate::settings::Settings;
use crate::sight::Sight;
use crate::units::Units;
use crate::wire::{Telegram, Wire};

/// An observer that the bench and a test share.
pub type SharedObserver = Rc<RefCell<Observer>>;

/// How often the axis is looked at: a period of the current loop.
const PERIOD: Nanoseconds = Nanoseconds(62_500);
/// Commands that change settings by themselves, and what they change.
const CHANGERS: [(u16, &[u16]); 4] = [
    (0x8000 | 220, &[100, 101, 104, 106, 107]),
    (0x8000 | 224, &[0x8000 | 111, 0x8000 | 112, 0x8000 | 113]),
    (0x8000 | 225, &[0x8000 | 114]),
    (0x8000 | 226, &[0x8000 | 221]),
];

/// Commands that begin with an axis without a reference, or end with another one.
const HOMINGS: [u16; 3] = [148, 191, 447];
/// P-0-0118.
const COMMUTATION_ANGLE: u16 = 0x8000 | 118;

/// A count that has slipped is found so late: in four loop ticks, and what is between them.
const SLIP: Nanoseconds = Nanoseconds::from_millis(1);
/// An MST that comes so much too early or too late is not in time.
const JITTER: Nanoseconds = Nanoseconds::from_microseconds(1);
/// Nor is a record so long after a cycle.
const LATE_MICROSECONDS: u64 = 100;

/// Command values: whoever changes one may lead the axis away.
const COMMANDS: [u16; 9] = [36, 37, 47, 48, 80, 81, 258, 282, 346];

/// Commands that give positions another zero, and values that give them another weight.
const REZEROES: [u16; 18] = [44, 45, 46, 55, 76, 77, 78, 79, 103, 116, 121, 122, 123, 148, 262, 263, 277, 447];

/// Watches one drive.
pub struct Observer {
    scene: Scene,
    dialogue: Dialogue,
    laws: Vec<(Box<dyn Law>, u64)>,
    broken: Option<Broken>,
    address: u8,
    looked: bool,
    /// When the last record came.
    record: Nanoseconds,
    /// `LAWS_TRACE` is in the environment: a line for every AT.
    traced: bool,
}

impl Observer {
    /// Of the drive of this address, which moves this machine.
    #[must_use]
    pub fn new(address: u8, machine: MachineSettings) -> Self {
        Self::with(address, machine, laws::all())
    }

    /// The drive was started with these values instead of its defaults: it remembers them.
    pub fn remember(&mut self, values: impl IntoIterator<Item = (Idn, Vec<u16>)>) {
        self.scene.settings.remember(values);
        self.scene.units = Units::of(&self.scene.settings);
    }

    /// Sees and judges nothing: for a drive whose processor is going to be taken away, of which no law holds.
    #[must_use]
    pub fn without_laws(address: u8, machine: MachineSettings) -> Self {
        Self::with(address, machine, Vec::new())
    }

    pub(crate) fn with(address: u8, machine: MachineSettings, laws: Vec<Box<dyn Law>>) -> Self {
        let settings = Settings::default();
        let scene = Scene {
            now: Nanoseconds::ZERO,
            sight: Sight::default(),
            before: Sight::default(),
            wire: Wire::new(address),
            units: Units::of(&settings),
            cycle: Nanoseconds::from_millis(2),
            settings,
            machine,
            disturbed: None,
            written: None,
            troubled: None,
            deceived: false,
            slipped: None,
            in_step_at: 0,
            pins_changed: None,
            bridge_changed: None,
            command: None,
            homing: false,
            starting: None,
            irregular: None,
            commanded: None,
            overpowered: None,
            rezeroed: None,
            path: VecDeque::new(),
        };
        let laws = laws.into_iter().map(|law| (law, 0)).collect();
        Self {
            scene,
            dialogue: Dialogue::default(),
            laws,
            broken: None,
            address,
            looked: false,
            record: Nanoseconds::ZERO,
            traced: std::env::var_os("LAWS_TRACE").is_some(),
        }
    }

    /// The first law that was broken.
    #[must_use]
    pub fn broken(&self) -> Option<&Broken> {
        self.broken.as_ref()
    }

    /// What is seen and heard.
    #[must_use]
    pub const fn scene(&self) -> &Scene {
        &self.scene
    }

    /// How often each law has had something to look at.
    pub fn coverage(&self) -> impl Iterator<Item = Coverage> {
        self.laws.iter().map(|(law, armed)| Coverage { law: law.sentence(), armed: *armed })
    }

    /// Takes a law away, for a test that turns what the law knows round and looks at the matter itself: the sentence of [`Coverage`].
    ///
    /// # Panics
    /// When there is no such law.
    pub fn dismiss(&mut self, law: &str) {
        let before = self.laws.len();
        self.laws.retain(|(known, _)| known.sentence() != law);
        assert_eq!(self.laws.len() + 1, before, "no law says: {law}");
    }

    /// When the axis wants to be looked at again.
    #[must_use]
    pub fn next_look(&self) -> Nanoseconds {
        self.scene.sight.time + PERIOD
    }

    /// Looks at the axis. Instants never go back.
    pub fn look(&mut self, sight: Sight) {
        let scene = &mut self.scene;
        let before = std::mem::replace(&mut scene.sight, sight);
        scene.before = if self.looked { before } else { sight };
        self.looked = true;
        let before = scene.before;
        scene.now = sight.time;
        let outside = |sight: &Sight| (sight.machine.load_torque, sight.machine.seized, sight.machine.kicks);
        if outside(&before) != outside(&sight) {
            scene.disturbed = Some(sight.time);
        }
        if sight.machine.load_torque != 0.0 && scene.load_is_stronger() {
            scene.overpowered = Some(sight.time);
        }
        if sight.is_troubled(scene.machine.supply.voltage) || before.pin_changes != sight.pin_changes {
            scene.troubled = Some(sight.time);
        }
        // Through a broken cable goes what nobody has asked for, as with sensors that lie.
        let lies = |sight: &Sight| sight.machine.blind || sight.machine.encoder_frozen || sight.machine.cable_broken;
        if before.machine.slips != sight.machine.slips {
            scene.slipped = Some(sight.time);
        }
        let slips = scene.slipped.is_some_and(|then| sight.time.saturating_sub(then) <= SLIP);
        scene.deceived |= lies(&sight) || slips;
        // What is switched on now has looked for its angle again, and is told the truth, unless the count has slipped while it was, or by so much that
        // an angle that is still the old one is wrong.
        scene.deceived &= before.bridge || !sight.bridge || lies(&sight) || slips || scene.is_out_of_step();
        let pins = |sight: &Sight| (sight.main_power, sight.bridge_ready, sight.safe_torque, sight.pin_changes);
        if pins(&before) != pins(&sight) {
            scene.pins_changed = Some(sight.time);
        }
        scene.path.push_back((Nanoseconds(sight.machine.time), sight.machine.angle));
        let old = sight.time.saturating_sub(scene.cycles(3, 0));
        while scene.path.front().is_some_and(|(time, _)| *time < old) {
            scene.path.pop_front();
        }
        if before.bridge != sight.bridge {
            scene.bridge_changed = Some(sight.time);
        }
        self.ask(&Event::Look);
    }

    fn ask(&mut self, event: &Event<'_>) {
        if self.broken.is_some() {
            return;
        }
        for (law, armed) in &mut self.laws {
            match law.judge(event, &self.scene) {
                Verdict::Silent => {}
                Verdict::Kept => *armed += 1,
                Verdict::Broken(detail) => {
                    let (law, address, time) = (law.sentence(), self.address, self.scene.now);
                    self.broken = Some(Broken { law, address, time, detail });
                    return;
                }
            }
        }
    }

    fn hear(&mut self, heard: &Heard) {
        // Laws compare what is read with what was known before it.
        self.ask(&Event::Service(heard));
        let scene = &mut self.scene;
        match heard {
            Heard::Written(idn, Element::Data, words) => {
                scene.settings.note(*idn, words.clone());
                scene.settings.note_written(*idn);
                scene.written = Some(scene.now);
                if REZEROES.contains(&idn.0) {
                    scene.rezeroed = Some(scene.now);
                }
                if COMMANDS.contains(&idn.0) {
                    scene.commanded = Some(scene.now);
                }
                if idn.0 == COMMUTATION_ANGLE {
                    scene.in_step_at = scene.sight.machine.slipped;
                }
                if matches!(idn.0, 148 | 447) {
                    scene.homing = words[..] == [3];
                }
                match words[..] {
                    [3] => {
                        scene.command = Some(*idn);
                        if HOMINGS.contains(&idn.0) {
                            scene.settings.forget(Idn(403));
                        }
                        for changed in
                            CHANGERS.iter().filter(|(command, _)| *command == idn.0).flat_map(|(_, all)| *all)
                        {
                            scene.settings.forget(Idn(*changed));
                        }
                        if *idn == Idn(263) {
                            scene.settings.load_saved();
                        }
                        if *idn == Idn(262) {
                            scene.settings.load_defaults(scene.wire.phase < 4);
                        }
                    }
                    [0] if scene.command == Some(*idn) => scene.command = None,
                    _ => {}
                }
            }
            Heard::Read(idn, Element::Data, words) => scene.settings.note(*idn, words.clone()),
            _ => return,
        }
        scene.units = Units::of(&scene.settings);
        let cycle = scene.settings.word(Idn::CYCLE).unwrap_or(2_000);
        scene.cycle = Nanoseconds::from_microseconds(cycle.into());
    }
}

/// With `LAWS_COVERAGE` in the environment an observer says at its end how often each law was armed: a law that never looks is noticed.
impl Drop for Observer {
    fn drop(&mut self) {
        if std::env::var_os("LAWS_COVERAGE").is_some() {
            for Coverage { law, armed } in self.coverage() {
                println!("{armed:>9}  drive {}: {law}", self.address);
            }
        }
    }
}

impl Tap for Observer {
    fn arrived(&mut self, _start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        let Ok(bytes) = frame else { return };
        let scene = &mut self.scene;
        scene.now = end.max(scene.now);
        match scene.wire.arrived(end, bytes, &scene.settings) {
            Some(Telegram::Mst) => {
                if scene.wire.phase == 0 {
                    if let Some(idn) = self.dialogue.reset() {
                        scene.settings.forget(idn);
                    }
                    scene.command = None;
                    scene.homing = false;
                }
                if scene.wire.phase_since == scene.wire.mst {
                    match scene.wire.phase {
                        2 => scene.settings.begin_set(),
                        4 => {
                            scene.settings.end_set();
                            scene.units = Units::of(&scene.settings);
                        }
                        _ => {}
                    }
                }
                if scene.wire.mst.0.abs_diff(scene.wire.mst_before.0 + scene.cycle.0) > JITTER.0 {
                    scene.irregular = Some(scene.now);
                }
                self.ask(&Event::Mst);
            }
            Some(Telegram::Record) => {
                if scene.wire.phase == 1 {
                    // Whatever comes in CP1 is where CP2 begins; nothing is written in CP0.
                    let _ = self.dialogue.reset();
                }
                self.dialogue.record(scene.wire.request());
                scene.starting = self.dialogue.starts();
                if scene.now.saturating_sub(self.record) > scene.cycles(1, LATE_MICROSECONDS) {
                    scene.irregular = Some(scene.now);
                }
                self.record = scene.now;
                if scene.wire.phase == 4 {
                    for (idn, value) in scene.wire.commands() {
                        if COMMANDS.contains(&idn.0) && scene.settings.is_led_away(*idn, *value, scene.units.as_ref()) {
                            scene.commanded = Some(scene.now);
                        }
                        scene.settings.note_cyclic(*idn, *value);
                    }
                }
                self.ask(&Event::Record);
            }
            None => {}
        }
    }

    fn sent(&mut self, now: Nanoseconds, bytes: &[u8]) {
        let scene = &mut self.scene;
        scene.now = now.max(scene.now);
        scene.wire.sent(now, bytes, &scene.settings);
        let heard = self.dialogue.answer(scene.wire.reply());
        if matches!(&heard, Some(Heard::Written(idn, Element::Data, _)) if REZEROES.contains(&idn.0)) {
            // The AT that acknowledges it may show the new coordinate already.
            scene.rezeroed = Some(scene.now);
        }
        if self.traced {
            println!("{}", scene.words());
        }
        self.ask(&Event::Answer);
        if let Some(heard) = heard {
            self.hear(&heard);
        }
    }
}
