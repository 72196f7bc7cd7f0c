#![allow(missing_docs)]
use fault_matrix::*;
use Fault::*; use Mode::*; use State::*;
fn main() {
    let mut cells = vec![];
    let general = [Overcurrent, CurrentSum, ConvertersStuck, Overvoltage, MainsFailure, MainPowerLost, GateDriver, EncoderFrozen, EncoderSlip, EncoderJump, CommutationDisturbed, MotorHot, MotorWarm, HeatSinkHot, TemperatureSensorBroken, AxisBlocked, Overspeed, SafeTorqueOff, OneSafeTorqueChannel, RingJitter, MstLost, MdtLost, TwoMstsLost, TwoMdtsLost, FibreBroken, PhaseRegression, OneLateCycle, LateCycles];
    for fault in general { for mode in [Torque, Velocity, Position, PositionWithoutLag] { cells.push(Cell { fault, state: AtSpeed, mode }); }
        for state in [Off, SwitchingOn, Standstill, Halted, Stopping] { cells.push(Cell { fault, state, mode: Velocity }); } }
    for mode in [Velocity, Position] { cells.push(Cell{fault: PositionLimit, state: AtSpeed, mode}); }
    for mode in [Torque, Velocity, Position] { cells.push(Cell{fault: Overload, state: AtSpeed, mode}); }
    for f in [BrakeStuckClosed, BrakeOpensLate] { cells.push(Cell{fault: f, state: SwitchingOn, mode: PositionWithoutLag}); }
    for f in [BrakeStuckOpen, BrakeWorn] { cells.push(Cell{fault: f, state: Stopping, mode: PositionWithoutLag}); }
    let filter = std::env::args().nth(1).unwrap_or_default();
    let cells: Vec<_> = cells.into_iter().filter(|c| format!("{c:?}").contains(&filter)).collect();
    let t = std::time::Instant::now();
    let next = std::sync::atomic::AtomicUsize::new(0);
    std::thread::scope(|s| { for _ in 0..2 { s.spawn(|| loop {
        let i = next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let Some(&cell) = cells.get(i) else { break };
        let r = std::panic::catch_unwind(|| run(cell));
        match r { Ok(Ok(o)) => println!("{cell:?} => {:?} off={:?} turned={:?} {:04X} c1={:04x} brake={:?} {:?}", o.reaction, o.torque_off.map(|t| t.0 as f64 / 1e6), o.turned.map(|t| t.round()), o.number, o.class_1, o.brake_closed, o.afterwards), Ok(Err(e)) => println!("{cell:?} => ERROR {e}"), Err(_) => println!("{cell:?} => PANIC") }
    }); } });
    println!("{} cells {:?}", cells.len(), t.elapsed());
}
