//! An oscilloscope in the drive: four signals, 2 048 points, a trigger with the time before it.
//!
//! [`Scope::sample`] is called in every tick of a loop and keeps every n-th row of values in a ring buffer. The ring goes round until the
//! trigger has come and the points behind it are complete; then it stands still and is read, in order of time, with the trigger at the
//! index that the settings call pre-trigger.
//!
//! A call takes constant time: one row of four values is written at an index that wraps by a mask, and one value is compared.
//!
//! The memory is 2 048 points of 4 channels of 4 bytes: 32 KiB, a quarter of the 128 KiB that the microcontroller has for everything.
//! Keep one [`Scope`] in a static and lend it; moving it would need the same room again on a stack.

use core::fmt;

/// Points that each channel keeps; a power of two.
pub const SCOPE_POINTS: usize = 2_048;

/// Signals that are recorded side by side.
pub const SCOPE_CHANNELS: usize = 4;

/// Largest index of a point.
const LAST: u16 = SCOPE_POINTS as u16 - 1;

const _: () = assert!(SCOPE_POINTS.is_power_of_two(), "an index wraps by a mask");

/// What a recording waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ScopeEdge {
    /// Nothing: the first point behind the pre-trigger is the trigger.
    #[default]
    Immediate,
    /// The first point at or above the level after one below it.
    Rising,
    /// The first point at or below the level after one above it.
    Falling,
}

/// When a recording triggers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ScopeTrigger {
    /// Channel that is compared with the level, 0 ..= 3.
    pub channel: u8,
    /// Which crossing of the level counts.
    pub edge: ScopeEdge,
    /// In the unit of that channel.
    pub level: i32,
}

impl ScopeTrigger {
    #[inline]
    const fn is_crossing(&self, previous: Option<i32>, value: i32) -> bool {
        match (self.edge, previous) {
            (ScopeEdge::Immediate, _) => true,
            // Without a point before, nobody knows on which side the signal was.
            (_, None) => false,
            (ScopeEdge::Rising, Some(previous)) => previous < self.level && value >= self.level,
            (ScopeEdge::Falling, Some(previous)) => previous > self.level && value <= self.level,
        }
    }
}

/// Settings that a [`Scope`] cannot work with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ScopeSettingsError {
    /// The trigger channel must be 0 to 3.
    Channel {
        /// Channel given.
        actual: u8,
    },
    /// The pre-trigger must be 0 to 2 047 points: the trigger itself is one of the 2 048.
    PreTrigger {
        /// Points asked for.
        actual: u16,
    },
    /// The divider must be 1 to 65 535.
    Divider,
    /// No signal can rise to the smallest or fall to the largest value that there is.
    Level {
        /// Level given.
        actual: i32,
    },
}

impl fmt::Display for ScopeSettingsError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Channel { actual } => write!(formatter, "trigger channel {actual}, expected 0 to 3"),
            Self::PreTrigger { actual } => write!(formatter, "pre-trigger of {actual} points, expected at most {LAST}"),
            Self::Divider => formatter.write_str("sampling divider of 0, expected 1 to 65535"),
            Self::Level { actual } => write!(formatter, "no signal can cross the trigger level {actual}"),
        }
    }
}

impl core::error::Error for ScopeSettingsError {}

/// Settings of a recording. The default triggers at once, without pre-trigger, and keeps the row of every call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ScopeSettings {
    trigger: ScopeTrigger,
    pre_trigger: u16,
    /// Calls that are passed over between two points.
    skipped: u16,
}

impl ScopeSettings {
    /// * `pre_trigger`: points that are kept from before the trigger, 0 ..= 2 047.
    /// * `divider`: every so many calls of [`Scope::sample`] give a point, 1 ..= 65 535.
    ///
    /// # Errors
    /// The first setting that is out of its range.
    pub const fn new(trigger: ScopeTrigger, pre_trigger: u16, divider: u16) -> Result<Self, ScopeSettingsError> {
        if trigger.channel as usize >= SCOPE_CHANNELS {
            return Err(ScopeSettingsError::Channel { actual: trigger.channel });
        }
        if pre_trigger > LAST {
            return Err(ScopeSettingsError::PreTrigger { actual: pre_trigger });
        }
        let Some(skipped) = divider.checked_sub(1) else { return Err(ScopeSettingsError::Divider) };
        match (trigger.edge, trigger.level) {
            (ScopeEdge::Rising, i32::MIN) | (ScopeEdge::Falling, i32::MAX) => {
                Err(ScopeSettingsError::Level { actual: trigger.level })
            }
            _ => Ok(Self { trigger, pre_trigger, skipped }),
        }
    }

    /// When the recording triggers.
    #[must_use]
    pub const fn trigger(&self) -> ScopeTrigger {
        self.trigger
    }

    /// Points before the trigger, which is the index of the trigger.
    #[must_use]
    pub const fn pre_trigger(&self) -> u16 {
        self.pre_trigger
    }

    /// Every so many calls give a point.
    #[must_use]
    pub const fn divider(&self) -> u16 {
        self.skipped.wrapping_add(1)
    }
}

/// How far a recording is; the numbers are those of the data block that shows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u16)]
pub enum ScopeState {
    /// Nothing is recorded, and nothing can be read.
    #[default]
    Idle = 0,
    /// The points before the trigger are being filled in; the trigger is not looked at yet.
    Armed = 1,
    /// Waits for the trigger.
    Waiting = 2,
    /// The points behind the trigger are being filled in.
    Triggered = 3,
    /// Complete; the points can be read.
    Done = 4,
}

/// The oscilloscope. Its first value is all zero, so that a static of it takes no flash.
pub struct Scope {
    points: [[i32; SCOPE_CHANNELS]; SCOPE_POINTS],
    settings: ScopeSettings,
    state: ScopeState,
    /// Calls that are still passed over.
    skip: u16,
    /// Where the next row goes; the oldest row once the ring has gone round.
    next: u16,
    /// Points until the state ends, in `Armed` and `Triggered`.
    missing: u16,
    /// The trigger channel in the point before.
    previous: Option<i32>,
}

impl fmt::Debug for Scope {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Nobody wants to see 8 192 numbers.
        let mut fields = formatter.debug_struct("Scope");
        fields.field("settings", &self.settings).field("state", &self.state).finish_non_exhaustive()
    }
}

impl Default for Scope {
    fn default() -> Self {
        Self::new()
    }
}

impl Scope {
    /// Idle.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            points: [[0; SCOPE_CHANNELS]; SCOPE_POINTS],
            settings: ScopeSettings {
                trigger: ScopeTrigger { channel: 0, edge: ScopeEdge::Immediate, level: 0 },
                pre_trigger: 0,
                skipped: 0,
            },
            state: ScopeState::Idle,
            skip: 0,
            next: 0,
            missing: 0,
            previous: None,
        }
    }

    /// Begins a recording with these settings, in any state; what was recorded before is lost. The first call of [`Scope::sample`] gives
    /// the first point.
    pub const fn arm(&mut self, settings: ScopeSettings) {
        self.settings = settings;
        self.state = if settings.pre_trigger == 0 { ScopeState::Waiting } else { ScopeState::Armed };
        self.missing = settings.pre_trigger;
        self.skip = 0;
        self.previous = None;
    }

    /// Gives a recording up, also a complete one.
    pub const fn stop(&mut self) {
        self.state = ScopeState::Idle;
    }

    /// How far the recording is.
    #[must_use]
    pub const fn state(&self) -> ScopeState {
        self.state
    }

    /// Whether [`Scope::sample`] has a use for values.
    #[inline]
    #[must_use]
    pub const fn is_recording(&self) -> bool {
        matches!(self.state, ScopeState::Armed | ScopeState::Waiting | ScopeState::Triggered)
    }

    /// Settings of the recording that runs or is complete.
    #[must_use]
    pub const fn settings(&self) -> &ScopeSettings {
        &self.settings
    }

    /// One tick of the loop: the values of all channels. Does nothing while no recording runs.
    #[inline]
    pub fn sample(&mut self, values: &[i32; SCOPE_CHANNELS]) {
        if !self.is_recording() {
            return;
        }
        if self.skip > 0 {
            self.skip = self.skip.wrapping_sub(1);
            return;
        }
        self.skip = self.settings.skipped;
        if let Some(row) = self.points.get_mut(usize::from(self.next)) {
            *row = *values;
        }
        self.next = self.next.wrapping_add(1) & LAST;
        let trigger = self.settings.trigger;
        let value = values.get(usize::from(trigger.channel)).copied().unwrap_or(0);
        let crossing = trigger.is_crossing(self.previous, value);
        self.previous = Some(value);
        match self.state {
            ScopeState::Armed => self.count_down(ScopeState::Waiting),
            ScopeState::Waiting if crossing => {
                // The trigger itself is one of the points; this counts it.
                self.missing = LAST.wrapping_sub(self.settings.pre_trigger).wrapping_add(1);
                self.state = ScopeState::Triggered;
                self.count_down(ScopeState::Done);
            }
            ScopeState::Triggered => self.count_down(ScopeState::Done),
            ScopeState::Idle | ScopeState::Waiting | ScopeState::Done => {}
        }
    }

    /// A point of a complete recording: `channel` 0 ..= 3, `index` 0 ..= 2 047 in order of time, the trigger at the pre-trigger.
    /// `None` behind these, and before the recording is complete.
    #[must_use]
    pub fn point(&self, channel: usize, index: usize) -> Option<i32> {
        if self.state != ScopeState::Done || index >= SCOPE_POINTS {
            return None;
        }
        let place = usize::from(self.next).wrapping_add(index) & usize::from(LAST);
        self.points.get(place)?.get(channel).copied()
    }

    #[inline]
    fn count_down(&mut self, then: ScopeState) {
        self.missing = self.missing.wrapping_sub(1);
        if self.missing == 0 {
            self.state = then;
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn settings(channel: u8, edge: ScopeEdge, level: i32, pre_trigger: u16, divider: u16) -> ScopeSettings {
        ScopeSettings::new(ScopeTrigger { channel, edge, level }, pre_trigger, divider).unwrap()
    }

    /// A row that tells the call it was given in, and its channels from one another.
    fn row(call: i32) -> [i32; SCOPE_CHANNELS] {
        [call, -call, call + 1_000_000, 7]
    }

    /// Feeds rows from `first` on until the recording is complete; gives the number of the first row that was not needed.
    fn record(scope: &mut Scope, first: i32) -> i32 {
        let mut call = first;
        while scope.is_recording() {
            scope.sample(&row(call));
            call += 1;
            assert!(call < first + 100_000, "{:?}", scope.state());
        }
        call
    }

    fn channel(scope: &Scope, channel: usize) -> Vec<i32> {
        (0..SCOPE_POINTS).map(|index| scope.point(channel, index).unwrap()).collect()
    }

    #[test]
    fn a_rising_signal_triggers_at_the_first_point_that_reaches_the_level() {
        let mut scope = Scope::new();
        scope.arm(settings(0, ScopeEdge::Rising, 5_000, 100, 1));
        let end = record(&mut scope, 0);
        assert_eq!(scope.state(), ScopeState::Done);
        assert_eq!(scope.point(0, 100), Some(5_000));
        assert_eq!(scope.point(0, 99), Some(4_999));
        assert_eq!(end, 5_000 - 100 + 2_048, "not a point more than needed");
    }

    #[test]
    fn a_falling_signal_triggers_when_it_steps_over_the_level() {
        let mut scope = Scope::new();
        scope.arm(settings(2, ScopeEdge::Falling, 10, 3, 1));
        for value in [20, 11, 9, 30, 12, 11, 4, 50] {
            scope.sample(&[0, 0, value, 0]);
        }
        // 9 comes while the pre-trigger is being filled; 4 is the first crossing that counts.
        assert_eq!(scope.state(), ScopeState::Triggered);
        for _ in 0..2_048 - 3 - 2 {
            scope.sample(&[0; 4]);
        }
        assert_eq!(scope.state(), ScopeState::Done);
        let first: Vec<_> = (0..5).map(|index| scope.point(2, index)).collect();
        assert_eq!(first, [30, 12, 11, 4, 50].map(Some));
    }

    #[test]
    fn a_signal_that_stands_at_the_level_or_falls_through_it_is_no_rising_edge() {
        let mut scope = Scope::new();
        scope.arm(settings(0, ScopeEdge::Rising, 10, 0, 1));
        for value in [10, 10, 11, 10, 9, 8] {
            scope.sample(&[value, 0, 0, 0]);
            assert_eq!(scope.state(), ScopeState::Waiting, "{value}");
        }
        scope.sample(&[10, 0, 0, 0]);
        assert_eq!(scope.state(), ScopeState::Triggered);
    }

    #[test]
    fn the_point_that_completes_the_pre_trigger_is_known_to_the_next_one() {
        let mut scope = Scope::new();
        scope.arm(settings(0, ScopeEdge::Rising, 0, 2, 1));
        for (value, state) in
            [(-5, ScopeState::Armed), (-1, ScopeState::Waiting), (0, ScopeState::Triggered), (1, ScopeState::Triggered)]
        {
            scope.sample(&[value, 0, 0, 0]);
            assert_eq!(scope.state(), state, "{value}");
        }
    }

    #[test]
    fn without_an_edge_the_first_point_behind_the_pre_trigger_is_the_trigger() {
        for pre_trigger in [0, 1, 2_046, 2_047] {
            let mut scope = Scope::new();
            scope.arm(settings(0, ScopeEdge::Immediate, 0, pre_trigger, 1));
            assert_eq!(record(&mut scope, 0), 2_048, "{pre_trigger}");
            assert_eq!(scope.point(0, usize::from(pre_trigger)), Some(pre_trigger.into()));
            assert_eq!(channel(&scope, 0), (0..2_048).collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_longest_pre_trigger_ends_with_the_trigger_itself() {
        let mut scope = Scope::new();
        scope.arm(settings(0, ScopeEdge::Rising, 7_000, 2_047, 1));
        assert_eq!(record(&mut scope, 0), 7_001);
        assert_eq!(scope.point(0, 2_047), Some(7_000));
        assert_eq!(scope.point(0, 0), Some(7_000 - 2_047));
    }

    #[test]
    fn the_divider_keeps_the_first_call_and_every_nth_after_it() {
        for divider in [1_u16, 2, 3, 65_535] {
            let mut scope = Scope::new();
            scope.arm(settings(0, ScopeEdge::Immediate, 0, 5, divider));
            let divider = i64::from(divider);
            let mut kept = Vec::new();
            for call in 0..divider * 8 {
                let before = scope.next;
                scope.sample(&row(call as i32));
                if scope.next != before {
                    kept.push(call);
                }
            }
            assert_eq!(kept, (0..8).map(|point| point * divider).collect::<Vec<_>>(), "{divider}");
        }
    }

    #[test]
    fn all_channels_wrap_round_the_ring_together() {
        let mut scope = Scope::new();
        scope.arm(settings(1, ScopeEdge::Falling, -5_000, 1_024, 3));
        record(&mut scope, 0);
        let first = scope.point(0, 0).unwrap();
        assert_eq!(scope.point(0, 1_024), Some(5_001), "the first of every third call at or behind 5 000");
        let calls: Vec<i32> = (0..2_048).map(|point| first + 3 * point).collect();
        for (index, kept) in calls.iter().map(|&call| row(call)).enumerate() {
            for (channel, value) in kept.into_iter().enumerate() {
                assert_eq!(scope.point(channel, index), Some(value));
            }
        }
    }

    #[test]
    fn a_complete_recording_stands_still_until_it_is_armed_again() {
        let mut scope = Scope::new();
        scope.arm(settings(0, ScopeEdge::Immediate, 0, 0, 1));
        let end = record(&mut scope, 0);
        let kept = channel(&scope, 0);
        scope.sample(&row(end));
        assert_eq!((scope.state(), channel(&scope, 0)), (ScopeState::Done, kept));
        scope.arm(settings(0, ScopeEdge::Rising, 20_000, 10, 1));
        assert_eq!((scope.state(), scope.point(0, 0)), (ScopeState::Armed, None));
        record(&mut scope, end);
        assert_eq!(channel(&scope, 0), (19_990..19_990 + 2_048).collect::<Vec<_>>());
    }

    #[test]
    fn arming_with_other_settings_in_the_middle_of_a_recording_begins_anew_with_them() {
        let mut scope = Scope::new();
        scope.arm(settings(0, ScopeEdge::Rising, 500, 400, 7));
        for call in 0..3_400 {
            scope.sample(&row(call));
        }
        assert_eq!(scope.state(), ScopeState::Waiting);
        // The signal has been above the new level for long: what was seen before does not count.
        scope.arm(settings(0, ScopeEdge::Rising, 1_000, 0, 1));
        scope.sample(&row(4_000));
        assert_eq!(scope.state(), ScopeState::Waiting);
        scope.sample(&row(999));
        record(&mut scope, 1_000);
        assert_eq!(channel(&scope, 0), (1_000..1_000 + 2_048).collect::<Vec<_>>());
    }

    #[test]
    fn nothing_can_be_read_before_the_recording_is_complete_or_behind_its_ends() {
        let mut scope = Scope::new();
        scope.sample(&row(1));
        assert_eq!((scope.state(), scope.point(0, 0)), (ScopeState::Idle, None));
        scope.arm(settings(0, ScopeEdge::Immediate, 0, 0, 1));
        for call in 0..2_047 {
            scope.sample(&row(call));
            assert_eq!(scope.point(0, 0), None);
        }
        scope.sample(&row(2_047));
        assert_eq!((scope.point(0, 0), scope.point(3, 2_047)), (Some(0), Some(7)));
        assert_eq!((scope.point(4, 0), scope.point(0, 2_048)), (None, None));
        scope.stop();
        assert_eq!((scope.state(), scope.point(0, 0)), (ScopeState::Idle, None));
    }

    #[test]
    fn settings_that_cannot_work_are_refused_with_their_value() {
        let new = |channel, edge, level, pre_trigger, divider| {
            ScopeSettings::new(ScopeTrigger { channel, edge, level }, pre_trigger, divider).map(|_| ())
        };
        use ScopeEdge::{Falling, Immediate, Rising};
        assert_eq!(new(3, Rising, i32::MAX, 2_047, 65_535), Ok(()));
        assert_eq!(new(3, Falling, i32::MIN, 0, 1), Ok(()));
        assert_eq!(new(4, Immediate, 0, 0, 1), Err(ScopeSettingsError::Channel { actual: 4 }));
        assert_eq!(new(0, Immediate, 0, 2_048, 1), Err(ScopeSettingsError::PreTrigger { actual: 2_048 }));
        assert_eq!(new(0, Immediate, 0, 0, 0), Err(ScopeSettingsError::Divider));
        assert_eq!(new(0, Rising, i32::MIN, 0, 1), Err(ScopeSettingsError::Level { actual: i32::MIN }));
        assert_eq!(new(0, Falling, i32::MAX, 0, 1), Err(ScopeSettingsError::Level { actual: i32::MAX }));
        assert_eq!(new(0, Immediate, i32::MIN, 0, 1), Ok(()), "nobody looks at the level");
        assert_eq!(settings(0, Immediate, 0, 0, 65_535).divider(), 65_535);
    }

    /// What the scope should do, by keeping everything.
    struct Naive {
        settings: ScopeSettings,
        calls: usize,
        kept: Vec<[i32; SCOPE_CHANNELS]>,
    }

    impl Naive {
        fn sample(&mut self, values: [i32; SCOPE_CHANNELS]) {
            if self.calls.is_multiple_of(usize::from(self.settings.divider())) {
                self.kept.push(values);
            }
            self.calls += 1;
        }

        fn trigger(&self) -> Option<usize> {
            let ScopeTrigger { channel, edge, level } = self.settings.trigger();
            let value = |point: usize| self.kept[point][usize::from(channel)];
            (usize::from(self.settings.pre_trigger())..self.kept.len()).find(|&point| match edge {
                ScopeEdge::Immediate => true,
                ScopeEdge::Rising => point > 0 && value(point - 1) < level && value(point) >= level,
                ScopeEdge::Falling => point > 0 && value(point - 1) > level && value(point) <= level,
            })
        }

        fn recording(&self) -> Option<&[[i32; SCOPE_CHANNELS]]> {
            let first = self.trigger()? - usize::from(self.settings.pre_trigger());
            self.kept.get(first..first + SCOPE_POINTS)
        }

        fn state(&self) -> ScopeState {
            match (self.recording(), self.trigger()) {
                (Some(_), _) => ScopeState::Done,
                (None, Some(_)) => ScopeState::Triggered,
                (None, None) if self.kept.len() < usize::from(self.settings.pre_trigger()) => ScopeState::Armed,
                (None, None) => ScopeState::Waiting,
            }
        }
    }

    prop_compose! {
        fn any_settings()(
            channel in 0_u8..4,
            edge in prop_oneof![Just(ScopeEdge::Immediate), Just(ScopeEdge::Rising), Just(ScopeEdge::Falling)],
            level in -20..20,
            pre_trigger in prop_oneof![0_u16..4, 0_u16..2_048, 2_044_u16..2_048],
            divider in 1_u16..5,
        ) -> ScopeSettings {
            settings(channel, edge, level, pre_trigger, divider)
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(100))]

        #[test]
        fn a_recording_is_what_somebody_who_keeps_everything_would_cut_out(
            settings in any_settings(),
            before in 0_i32..3_000,
            calls in 0_usize..14_000,
            seed: u32,
        ) {
            let mut scope = Scope::new();
            // The ring begins somewhere, with remains of another recording.
            scope.arm(ScopeSettings::default());
            for call in 0..before {
                scope.sample(&row(call));
            }
            scope.arm(settings);
            let mut naive = Naive { settings, calls: 0, kept: Vec::new() };
            let mut random = seed;
            let mut walk = [0_i32; SCOPE_CHANNELS];
            for _ in 0..calls {
                for value in &mut walk {
                    random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    *value = (*value + (random >> 24) as i32 % 7 - 3).clamp(-25, 25);
                }
                scope.sample(&walk);
                naive.sample(walk);
            }
            prop_assert_eq!(scope.state(), naive.state());
            if let Some(recording) = naive.recording() {
                for (index, kept) in recording.iter().enumerate() {
                    for (channel, value) in kept.iter().enumerate() {
                        prop_assert_eq!(scope.point(channel, index), Some(*value));
                    }
                }
            }
        }
    }
}
