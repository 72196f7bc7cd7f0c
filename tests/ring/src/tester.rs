//! A master of which a test decides every telegram, right or wrong.
//!
//! It has a rhythm and nothing else: each cycle it sends what its [`Plan`] says at that moment, and keeps what comes back. Service
//! channel, phases and slots are the test's business.

use crate::master::beat::{Act, Beat};
use crate::master::listener::Listener;
use crate::station::Master;
use crate::time::Nanoseconds;
use crate::wire::{BROADCAST, BitRate, LineError, Transmission, encode};

/// What the master sends in a cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Data byte of the MST; `None`: no MST.
    pub mst: Option<u8>,
    /// The MDT: when it starts after the end of the MST, and its address and data.
    pub mdt: Option<(Nanoseconds, Vec<u8>)>,
    /// From the end of this MST to the end of the next.
    pub cycle: Nanoseconds,
}

impl Plan {
    /// An MST and no MDT.
    #[must_use]
    pub const fn mst_only(phase: u8, cycle: Nanoseconds) -> Self {
        Self { mst: Some(phase), mdt: None, cycle }
    }
}

/// A telegram that has come round the ring and was not the master's own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReceivedAt {
    /// From the end of the MST as it came back to the start of the telegram; `None` in a cycle without one.
    pub after_mst: Option<Nanoseconds>,
    /// Address and data.
    pub bytes: Vec<u8>,
}

/// The master.
#[derive(Debug)]
pub struct Tester {
    beat: Beat,
    rate: BitRate,
    plan: Plan,
    listener: Listener,
    received: Vec<ReceivedAt>,
    line_errors: u32,
    cycles: u64,
    mdt_end: Nanoseconds,
    mark: Nanoseconds,
}

impl Tester {
    /// A master that sends this until it is told otherwise.
    #[must_use]
    pub fn new(rate: BitRate, plan: Plan) -> Self {
        let beat = Beat::new(rate, plan.cycle);
        Self {
            mark: beat.mark(),
            beat,
            rate,
            plan,
            listener: Listener::default(),
            received: Vec::new(),
            line_errors: 0,
            cycles: 0,
            mdt_end: Nanoseconds::ZERO,
        }
    }

    /// What it sends from the next MST on.
    pub fn set_plan(&mut self, plan: Plan) {
        self.plan = plan;
    }

    /// What the MDT of this cycle says, as long as it has not begun; nothing if this cycle has none.
    pub fn set_mdt(&mut self, bytes: Vec<u8>) {
        if let Some((_, planned)) = &mut self.plan.mdt {
            *planned = bytes;
        }
    }

    /// Everything that has come back in this cycle.
    #[must_use]
    pub fn received(&self) -> &[ReceivedAt] {
        &self.received
    }

    /// Whether this cycle's MST has come round.
    #[must_use]
    pub fn mst_has_returned(&self) -> bool {
        self.listener.mst_has_returned()
    }

    /// Telegrams with a bad check sequence so far.
    #[must_use]
    pub const fn line_errors(&self) -> u32 {
        self.line_errors
    }

    /// MSTs so far, those left out included.
    #[must_use]
    pub const fn cycles(&self) -> u64 {
        self.cycles
    }

    /// When the last MDT had left the master; it reaches a drive later by the delay of the fibres and stations before it.
    #[must_use]
    pub const fn mdt_end(&self) -> Nanoseconds {
        self.mdt_end
    }

    /// End of this cycle's MST, sent or left out; a cycle begins when its MST is decided on.
    #[must_use]
    pub const fn mark(&self) -> Nanoseconds {
        self.mark
    }

    /// The last instant at which a new plan counts for the next MST.
    #[must_use]
    pub fn end_of_cycle(&self) -> Nanoseconds {
        match self.beat.act() {
            Act::Decide => self.beat.time() - Nanoseconds(1),
            _ => self.beat.decision_after(self.plan.cycle) - Nanoseconds(1),
        }
    }

    /// Bit rate of the ring.
    #[must_use]
    pub const fn bit_rate(&self) -> BitRate {
        self.rate
    }
}

impl Master for Tester {
    fn next_transmission(&self) -> Option<Nanoseconds> {
        Some(self.beat.time())
    }

    fn transmit(&mut self, now: Nanoseconds) -> Option<Transmission> {
        match self.beat.act() {
            Act::Decide => {
                self.mark = self.beat.mark();
                self.received.clear();
                self.listener.begin_cycle();
                self.beat.mst_comes(self.plan.mst.unwrap_or(0));
                None
            }
            Act::Mst(phase) => {
                self.cycles += 1;
                match &self.plan.mdt {
                    Some((after, _)) => self.beat.mdt_comes(*after),
                    None => self.beat.cycle_comes(self.plan.cycle),
                }
                self.plan.mst.map(|_| Transmission { bytes: vec![BROADCAST, phase] })
            }
            Act::Mdt => {
                self.beat.cycle_comes(self.plan.cycle);
                let bytes = self.plan.mdt.as_ref().map(|(_, bytes)| bytes.clone())?;
                self.listener.mdt_sent(&bytes);
                self.mdt_end = now + self.rate.span(encode(&bytes).len());
                Some(Transmission { bytes })
            }
        }
    }

    fn receive(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        match frame {
            Err(_) => self.line_errors += 1,
            Ok(bytes) if self.listener.is_at(self.plan.mst.unwrap_or(0), end, bytes) => {
                let after_mst = self.listener.since_mst(start);
                self.received.push(ReceivedAt { after_mst, bytes: bytes.to_vec() });
            }
            Ok(_) => {}
        }
    }
}
