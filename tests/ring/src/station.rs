//! What stands between two hops: a drive's chip, or anything that behaves like one.

use std::cell::RefCell;
use std::rc::Rc;

use crate::time::Nanoseconds;
use crate::wire::{LineError, Transmission};

/// A station of the ring as the fibre sees it. The SERCON816 model is one; so are the scripted slaves of the tests.
pub trait Station {
    /// The next instant at which [`Station::on_time`] wants to be called, if there is one.
    fn next_event(&self) -> Option<Nanoseconds>;

    /// An instant that was asked for, or a later one, is there. A transmission that is returned starts `now`.
    fn on_time(&mut self, now: Nanoseconds) -> Option<Transmission>;

    /// The opening flag of a telegram has been received.
    fn on_telegram_start(&mut self, now: Nanoseconds);

    /// A telegram has ended now, at `end`; its opening flag began at `start`. `frame` is address and data.
    fn on_telegram(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>);

    /// The receiver sees light, or no longer does.
    fn on_signal(&mut self, now: Nanoseconds, present: bool);

    /// Whether what is received is passed on while the station itself does not send.
    fn repeats(&self) -> bool {
        true
    }
}

/// The master station as the ring sees it; its repeater is off, so what comes back ends here.
pub trait Master {
    /// The next instant at which [`Master::transmit`] wants to be called, if there is one.
    fn next_transmission(&self) -> Option<Nanoseconds>;

    /// That instant is there: the telegram that starts `now`, if any.
    fn transmit(&mut self, now: Nanoseconds) -> Option<Transmission>;

    /// Something has come round the ring: an AT, or a telegram of the master itself. `end` is now.
    fn receive(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>);

    /// The master's receiver sees light, or no longer does.
    fn on_signal(&mut self, now: Nanoseconds, present: bool) {
        let _ = (now, present);
    }
}

/// An ear at the fibre of one station. It changes nothing.
pub trait Tap {
    /// A telegram has ended at the station's receiver, at `end`; its opening flag began at `start`. `frame` is address and data.
    fn arrived(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>);

    /// The station begins to send these bytes, address and data.
    fn sent(&mut self, now: Nanoseconds, bytes: &[u8]);
}

/// An ear that its owner keeps.
pub type SharedTap = Rc<RefCell<dyn Tap>>;

impl<S: Station + ?Sized> Station for Box<S> {
    fn next_event(&self) -> Option<Nanoseconds> {
        (**self).next_event()
    }
    fn on_time(&mut self, now: Nanoseconds) -> Option<Transmission> {
        (**self).on_time(now)
    }
    fn on_telegram_start(&mut self, now: Nanoseconds) {
        (**self).on_telegram_start(now);
    }
    fn on_telegram(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        (**self).on_telegram(start, end, frame);
    }
    fn on_signal(&mut self, now: Nanoseconds, present: bool) {
        (**self).on_signal(now, present);
    }
    fn repeats(&self) -> bool {
        (**self).repeats()
    }
}

impl<M: Master + ?Sized> Master for Box<M> {
    fn next_transmission(&self) -> Option<Nanoseconds> {
        (**self).next_transmission()
    }
    fn transmit(&mut self, now: Nanoseconds) -> Option<Transmission> {
        (**self).transmit(now)
    }
    fn receive(&mut self, start: Nanoseconds, end: Nanoseconds, frame: Result<&[u8], LineError>) {
        (**self).receive(start, end, frame);
    }
    fn on_signal(&mut self, now: Nanoseconds, present: bool) {
        (**self).on_signal(now, present);
    }
}
