//! P-0-0240 on its way: from the measurements on the motion side to the next one, and to the parameters.

use rtic_core::Mutex;
use sercon816::Bus;
use sercos::command::CommandState;
use sercos::parameters::Parameters;
use servo::motor::BoardKind;

use super::commissioning::{Finding, with_values};
use super::context::Context;
use super::tuning::Next;
use super::{hand_over, loops};
use crate::dictionary::procedures::Procedure;
use crate::hardware::Hardware;
use crate::motion::Motion;

impl<B, H, M> Context<'_, B, M>
where
    B: Bus + Clone,
    H: Hardware,
    M: Mutex<T = Motion<B, H>>,
{
    /// P-0-0240 begins.
    #[cold]
    #[inline(never)]
    pub(super) fn start_tuning(&mut self, parameters: &Parameters) -> Result<(), Finding> {
        let position = self.motion.lock(|motion| motion.position());
        self.commissioning.tuning.begin(position);
        self.measure(parameters)?;
        // Nobody would ask again.
        if self.commissioning.tuning.waits() {
            return Err(Finding::Interrupted);
        }
        self.commissioning.identifying = Some(Procedure::Tune);
        Ok(())
    }

    /// P-0-0240 goes on, if it is under way and anything has happened; how it has ended.
    #[cold]
    #[inline(never)]
    pub(super) fn tune(&mut self, parameters: &mut Parameters) -> Option<CommandState> {
        match self.tuning_step(parameters) {
            Ok(false) => None,
            Ok(true) => Some(self.end_tuning(Ok(()), parameters)),
            Err(finding) => Some(self.end_tuning(Err(finding), parameters)),
        }
    }

    /// The loops get back what the parameters say.
    pub(super) fn abandon_tuning(&mut self) {
        self.commissioning.tuning.end();
        self.settings_changed = true;
    }

    fn end_tuning(&mut self, result: Result<(), Finding>, parameters: &Parameters) -> CommandState {
        self.commissioning.identifying = None;
        self.motion.lock(|motion| motion.cancel_identification());
        self.abandon_tuning();
        self.taken(result, parameters)
    }

    /// Whether it is done.
    fn tuning_step(&mut self, parameters: &mut Parameters) -> Result<bool, Finding> {
        if self.commissioning.tuning.waits() {
            self.measure(parameters)?;
            return Ok(false);
        }
        let next = if self.commissioning.tuning.measured() {
            let Some(outcome) = self.motion.lock(|motion| motion.identified()) else { return Ok(false) };
            self.commissioning.tuning.take(outcome, parameters, <H::Board>::FACTS.frequency)?
        } else {
            self.commissioning.tuning.go_on()?
        };
        match next {
            Next::Wait => Ok(false),
            Next::Measure => self.measure(parameters).map(|()| false),
            Next::Try => {
                self.try_out(parameters)?;
                match self.commissioning.tuning.verify()? {
                    Next::Done => self.write_what_was_found(parameters).map(|()| true),
                    _ => self.measure(parameters).map(|()| false),
                }
            }
            Next::Done => self.write_what_was_found(parameters).map(|()| true),
        }
    }

    /// The next measurement begins, or waits until the axis stands.
    #[cold]
    #[inline(never)]
    fn measure(&mut self, parameters: &Parameters) -> Result<(), Finding> {
        let tuning = &mut self.commissioning.tuning;
        tuning.look()?;
        if !self.motion.lock(|motion| motion.may_identify()) {
            let waits = self.motion.lock(|motion| motion.is_free_in_halt()) && tuning.may_wait();
            return if waits { Ok(()) } else { Err(Finding::Interrupted) };
        }
        let (position, voltage) = self.motion.lock(|motion| (motion.position(), motion.longest_voltage()));
        let motion = &mut *self.motion;
        let plan = tuning.plan(parameters, <H::Board>::FACTS.frequency, position, voltage, |velocity| {
            motion.lock(|motion| motion.halt_distance(velocity))
        })?;
        self.motion.lock(|motion| motion.start_identification(&plan))?;
        self.commissioning.tuning.measures();
        Ok(())
    }

    /// The loops work with what was found; the parameters stay what they are.
    #[cold]
    #[inline(never)]
    fn try_out(&mut self, parameters: &mut Parameters) -> Result<(), Finding> {
        let values = self.commissioning.tuning.loop_values(parameters)?;
        let settings = with_values(parameters, values, |parameters| {
            loops::settings::<H>(parameters).map_err(|invalid| Finding::Refused(invalid.idn))
        })?;
        hand_over::by_parts(self.motion, &settings);
        Ok(())
    }

    #[cold]
    #[inline(never)]
    fn write_what_was_found(&mut self, parameters: &mut Parameters) -> Result<(), Finding> {
        self.commissioning.tuning.write(parameters, loops::accept::<H>)
    }
}
