//! Temperature sensors: a resistor that its temperature sets, the divider of the board before it, and the converter of 12 bits behind that.
//!
//! The resistors are those of formulas, with the figures that the makers and standards give for them. No table of a firmware is among them.

use crate::exponential::decay;
use crate::sensors::quantise;

/// 0 degrees Celsius in K.
const ZERO_CELSIUS: f64 = 273.15;

/// A resistor between the input and ground, or what stands in for it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ThermalResistor {
    /// Nothing is connected.
    Absent,
    /// KTY84-130: a parabola through 1 000 Ohm at 100 degrees Celsius (NXP KTY84, characteristics), good to 250 degrees Celsius.
    Kty84,
    /// Pt1000: the polynomials of IEC 60751.
    Pt1000,
    /// Metal oxide.
    Ntc(Ntc),
    /// PTC thermistors in series, each as weak as DIN 44081 lets it be.
    Ptc {
        /// Its nominal temperature in degrees Celsius.
        response: f64,
        /// How many there are.
        in_series: u32,
    },
    /// A switch that is open from a temperature in degrees Celsius on; closed, it and its wires have 2 Ohm.
    Switch {
        /// This temperature.
        opens_at: f64,
    },
}

/// A resistor with negative coefficient, by what a data sheet says of it: `R(T) = R25 exp(B (1/T - 1/T25))`, with a B that goes with `1/T` on the
/// straight line through the two that are given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ntc {
    /// Resistance at 25 degrees Celsius in Ohm.
    pub resistance: f64,
    /// B between 25 and 50 degrees Celsius in K.
    pub b_25_50: f64,
    /// B between 25 and 100 degrees Celsius in K.
    pub b_25_100: f64,
}

impl Ntc {
    /// 10 kOhm, B25/85 of 3 435 K (Murata NCP18XH103).
    pub const CHIP_10K: Self = Self { resistance: 10_000.0, b_25_50: 3_380.0, b_25_100: 3_455.0 };
    /// The sensor in a power module: 5 kOhm, B25/50 of 3 375 K (Infineon EconoPACK).
    pub const MODULE_5K: Self = Self { resistance: 5_000.0, b_25_50: 3_375.0, b_25_100: 3_433.0 };

    fn at(&self, celsius: f64) -> f64 {
        let from_25 = |celsius: f64| 1.0 / (celsius + ZERO_CELSIUS) - 1.0 / (25.0 + ZERO_CELSIUS);
        let (here, at_50, at_100) = (from_25(celsius), from_25(50.0), from_25(100.0));
        let b = self.b_25_50 + (self.b_25_100 - self.b_25_50) * (here - at_50) / (at_100 - at_50);
        let exponent = b * here;
        if exponent < 0.0 { self.resistance * decay(-exponent) } else { self.resistance / decay(exponent) }
    }
}

/// What DIN 44081 asks of a PTC thermistor: K from its nominal temperature, and Ohm.
const PTC: [(f64, f64); 4] = [(-20.0, 100.0), (-5.0, 550.0), (5.0, 1_330.0), (15.0, 4_000.0)];

impl ThermalResistor {
    /// In Ohm, at a temperature in degrees Celsius; infinite for none.
    #[must_use]
    pub fn resistance(&self, celsius: f64) -> f64 {
        match *self {
            Self::Absent => f64::INFINITY,
            Self::Kty84 => {
                let above = celsius - 100.0;
                1_000.0 * (1.0 + 6.12e-3 * above + 1.1e-5 * above * above)
            }
            Self::Pt1000 => {
                let parabola = 1.0 + 3.9083e-3 * celsius - 5.775e-7 * celsius * celsius;
                let below_zero = -4.183e-12 * (celsius - 100.0) * celsius * celsius * celsius;
                1_000.0 * if celsius < 0.0 { parabola + below_zero } else { parabola }
            }
            Self::Ntc(ntc) => ntc.at(celsius),
            Self::Ptc { response, in_series } => f64::from(in_series) * ptc(celsius - response),
            Self::Switch { opens_at } => {
                if celsius < opens_at {
                    2.0
                } else {
                    f64::INFINITY
                }
            }
        }
    }
}

/// A thermistor so far above its nominal temperature: straight lines from one demand to the next, and the last one on.
fn ptc(above: f64) -> f64 {
    let [first, middle @ .., last] = PTC;
    if above <= first.0 {
        return first.1;
    }
    let (mut from, mut to) = (first, last);
    for point in middle.into_iter().chain([last]) {
        to = point;
        if above < point.0 || point == last {
            break;
        }
        from = point;
    }
    from.1 + (to.1 - from.1) * (above - from.0) / (to.0 - from.0)
}

/// A sensor at an input of the board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermometer {
    /// What lies between the input and ground.
    pub resistor: ThermalResistor,
    /// From the input to the supply, in Ohm.
    pub pull_up: f64,
    /// Supply of that resistor, in V.
    pub supply: f64,
    /// Voltage of 4 096 counts, in V.
    pub reference: f64,
}

/// What happens to the wires of a sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ThermometerFailure {
    /// One is broken.
    BrokenWire,
    /// They touch each other.
    ShortCircuit,
}

impl Thermometer {
    /// The sensor of a power module on the heat sink, a KTY84 in the windings.
    pub const USUAL: [Self; 2] = [Self::with(ThermalResistor::Ntc(Ntc::MODULE_5K)), Self::with(ThermalResistor::Kty84)];

    /// Behind 2 200 Ohm and on the same 3.3 V as the converter.
    #[must_use]
    pub const fn with(resistor: ThermalResistor) -> Self {
        Self { resistor, pull_up: 2_200.0, supply: 3.3, reference: 3.3 }
    }

    pub(crate) fn check(&self) {
        let positive = self.pull_up > 0.0 && self.supply > 0.0 && self.reference > 0.0;
        assert!(positive, "pull-up, supply and reference of a thermometer must be positive");
    }

    /// Voltage of the input at a temperature in degrees Celsius.
    #[must_use]
    pub fn voltage(&self, celsius: f64, failure: Option<ThermometerFailure>) -> f64 {
        let resistance = match failure {
            None => self.resistor.resistance(celsius),
            Some(ThermometerFailure::BrokenWire) => f64::INFINITY,
            Some(ThermometerFailure::ShortCircuit) => 0.0,
        };
        if resistance.is_infinite() {
            return self.supply;
        }
        self.supply * resistance / (resistance + self.pull_up)
    }

    pub(crate) fn sample(&self, celsius: f64, failure: Option<ThermometerFailure>) -> u16 {
        quantise(self.voltage(celsius, failure) / self.reference * 4_096.0)
    }
}
