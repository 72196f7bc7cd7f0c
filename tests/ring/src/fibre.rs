//! The fibre: how long light takes from station to station, and what can happen to a telegram on the way.
//!
//! Faults are data: a list of [`Fault`]s says what happens to which telegram, in which cycle, between which stations.
//! Nothing is random, so a run with faults repeats itself to the nanosecond.

use std::ops::Range;

use crate::time::{Nanoseconds, SharedClock};
use crate::wire::{BROADCAST, BitRate, LineSignal};

/// Light in plastic or glass fibre: refractive index 1.5, 5 ns a metre.
const NANOSECONDS_PER_METRE: u64 = 5;

/// The way from one station to the next: hop 0 leads from the master to the first drive, hop `n` from the last of
/// `n` drives back to the master.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct Hop {
    /// Delay of the fibre, its driver and its receiver.
    pub fibre: Nanoseconds,
    /// Delay of the repeater at the hop's beginning; a station's own telegram does not pass it.
    pub repeater: Nanoseconds,
}

impl Hop {
    /// A fibre of so many metres behind a repeater that needs `repeater` to pass a bit on.
    pub const fn of_metres(metres: u64, repeater: Nanoseconds) -> Self {
        Self { fibre: Nanoseconds(metres * NANOSECONDS_PER_METRE), repeater }
    }
}

/// What a ring is made of, its stations apart.
#[derive(Clone, Debug)]
pub struct RingConfiguration {
    /// Bit rate of all stations.
    pub bit_rate: BitRate,
    /// From the master through every drive back to the master: one more than there are drives.
    pub hops: Vec<Hop>,
    /// What happens to telegrams on the way.
    pub faults: Vec<Fault>,
    /// The clock that the ring sets and its chips read.
    pub clock: SharedClock,
    /// Whether every telegram that is sent is kept for [`crate::ring::Ring::trace`].
    pub trace: bool,
}

impl RingConfiguration {
    /// A ring of `drives` drives, 5 m of fibre between them, repeaters of one bit time, no faults, no trace.
    pub fn new(drives: usize, bit_rate: BitRate) -> Self {
        let mut hops = vec![Hop::of_metres(5, bit_rate.span(1)); drives + 1];
        hops[0].repeater = Nanoseconds::ZERO;
        Self { bit_rate, hops, faults: Vec::new(), clock: SharedClock::default(), trace: false }
    }
}

/// Which telegram, told by its sender.
#[derive(Copy, Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TelegramKind {
    /// Master synchronisation telegram.
    Mst,
    /// Master data telegram, to one drive or to all.
    Mdt,
    /// The drive telegram of this address.
    At(u8),
}

impl TelegramKind {
    /// What the master sends: an MST is the telegram to all drives with a single byte (sercos2.md 1.3).
    pub fn of_master(bytes: &[u8]) -> Self {
        if matches!(bytes, [BROADCAST, _]) { Self::Mst } else { Self::Mdt }
    }
}

/// What happens to a telegram on a hop.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Effect {
    /// It does not arrive.
    Drop,
    /// One line bit (0 = first of the opening flag) arrives inverted.
    FlipBit(usize),
    /// It arrives late.
    Delay(Nanoseconds),
    /// It arrives a second time, so long after its end.
    Duplicate(Nanoseconds),
    /// It arrives as an MST with this phase byte and a right check sequence.
    Phase(u8),
    /// Its data byte `index` (0 = address) arrives as `value`, with a right check sequence.
    Byte {
        /// Index into address and data.
        index: usize,
        /// What stands there instead.
        value: u8,
    },
}

/// One thing that goes wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Cycles in which it does; the first MST of the master begins cycle 0.
    pub cycles: Range<u64>,
    /// Where it does; see [`Hop`].
    pub hop: usize,
    /// What it is.
    pub cause: Cause,
}

/// What a [`Fault`] is.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Something happens to one kind of telegram.
    Telegram(TelegramKind, Effect),
    /// The fibre is dark: nothing passes, and the stations behind it lose the signal.
    Break,
}

impl Fault {
    /// `effect` on the telegram of this kind in one cycle.
    pub const fn once(cycle: u64, hop: usize, kind: TelegramKind, effect: Effect) -> Self {
        Self { cycles: cycle..cycle + 1, hop, cause: Cause::Telegram(kind, effect) }
    }

    /// No light on `hop` from the MST of the first cycle until before that of the cycle behind the last.
    pub const fn ring_break(cycles: Range<u64>, hop: usize) -> Self {
        Self { cycles, hop, cause: Cause::Break }
    }
}

/// What arrives at the other end of a hop: the signal and how much later than expected.
pub(crate) fn crossing(
    signal: &LineSignal,
    duration: Nanoseconds,
    effects: &[Effect],
) -> Vec<(Option<LineSignal>, Nanoseconds)> {
    let mut arriving = vec![(None::<LineSignal>, Nanoseconds::ZERO)];
    for effect in effects {
        match *effect {
            Effect::Drop => arriving.clear(),
            Effect::Delay(delay) => arriving.iter_mut().for_each(|(_, late)| *late += delay),
            Effect::Duplicate(gap) => {
                let again: Vec<_> =
                    arriving.iter().map(|(signal, late)| (signal.clone(), *late + duration + gap)).collect();
                arriving.extend(again);
            }
            Effect::FlipBit(bit) => change(&mut arriving, signal, |signal| signal.with_flipped_bit(bit)),
            Effect::Phase(phase) => {
                change(&mut arriving, signal, |_| Some(LineSignal::of_telegram(&[BROADCAST, phase])))
            }
            Effect::Byte { index, value } => change(&mut arriving, signal, |signal| {
                let mut bytes = signal.telegram().ok()?.to_vec();
                *bytes.get_mut(index)? = value;
                Some(LineSignal::of_telegram(&bytes))
            }),
        }
    }
    arriving
}

fn change(
    arriving: &mut [(Option<LineSignal>, Nanoseconds)],
    original: &LineSignal,
    change: impl Fn(&LineSignal) -> Option<LineSignal>,
) {
    for (signal, _) in arriving {
        if let Some(changed) = change(signal.as_ref().unwrap_or(original)) {
            *signal = Some(changed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_masters_telegrams_are_told_apart() {
        assert_eq!(TelegramKind::of_master(&[255, 3]), TelegramKind::Mst);
        assert_eq!(TelegramKind::of_master(&[255, 7, 0, 0, 0]), TelegramKind::Mdt);
        assert_eq!(TelegramKind::of_master(&[4, 1, 0, 0, 0]), TelegramKind::Mdt);
    }

    #[test]
    fn effects_add_up() {
        let signal = LineSignal::of_telegram(&[255, 4]);
        let end = BitRate::M2.span(signal.len());
        let gap = Nanoseconds(1_000);
        let arriving = crossing(&signal, end, &[Effect::Phase(7), Effect::Duplicate(gap), Effect::Delay(gap)]);
        let late: Vec<_> = arriving.iter().map(|(_, late)| *late).collect();
        assert_eq!(late, [gap, end + gap + gap]);
        assert!(
            arriving
                .iter()
                .all(|(signal, _)| { signal.as_ref().is_some_and(|signal| signal.telegram() == Ok(&[255, 7][..])) })
        );
        assert!(crossing(&signal, end, &[Effect::Drop, Effect::Duplicate(gap)]).is_empty());
    }
}
