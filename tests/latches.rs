//! What the hardware latches for the flashed ELF, against the true shaft: the position of t4, the index, the probes.

use crate::elf::{FOLLOWS_THE_SHAFT, Turning, fine_press, worse};
use bench::DriveSetup;
use ring::Nanoseconds;
use ring::chip::{Alternatives, InterruptOutput, InterruptPin, RoutingSense};
use ring::ident::{Idn, Value};

const LINES: [InterruptPin; 2] = [InterruptPin::Int0, InterruptPin::Int1];

/// t4 of every cycle is moved through a whole period of the supervision, so that its handler is held up by each task in turn.
fn t4_through_all_tasks(turning: &mut Turning) {
    let (register, _) = turning.t4;
    let t4 = turning.bench.drive.chip.borrow_mut().read_register(Nanoseconds::ZERO, register);
    for earlier in (0..65).map(|step| 8 * step).chain([0]) {
        let now = turning.bench.world.now();
        turning.bench.drive.chip.borrow_mut().write_register(now, register, t4 - earlier);
        turning.bench.run(Nanoseconds::from_millis(2));
    }
}

fn latches_the_true_position(output: InterruptOutput, routing: RoutingSense) -> InterruptPin {
    let alternatives = Alternatives { interrupt_output: output, routing_sense: routing, ..Alternatives::default() };
    let mut turning = Turning::new(DriveSetup { alternatives, ..fine_press() }, 0.0, vec![]);
    let what = format!("{output:?}, {routing:?}");
    // It takes t4 from the parameters, and here the chip is told otherwise behind the drive's back.
    turning.bench.drive.laws.borrow_mut().dismiss(FOLLOWS_THE_SHAFT);
    turning.turn(1_000);
    // To the middle between t4 and the MST.
    let mut from = turning.watch_lines();
    while turning.edges_of_t4().is_empty() {
        turning.bench.run(Nanoseconds::from_microseconds(20));
    }
    let edge = turning.edges_of_t4()[0];
    let wait = edge.time + Nanoseconds::from_microseconds(250) - turning.bench.world.now();
    turning.bench.run(wait);
    t4_through_all_tasks(&mut turning);
    let (quiet, positions) = turning.worst_since(from);
    // A level ends with the acknowledgement, which comes behind the reading.
    let held_up = {
        let tape = turning.elf.tape.borrow();
        let edges: Vec<_> = tape.edges.iter().flatten().filter(|other| other.line == edge.line).collect();
        let late = edges.windows(2).filter(|pair| pair[0].status & turning.t4.1 != 0);
        late.map(|pair| pair[1].time - pair[0].time).max().unwrap()
    };
    from = turning.bench.world.now();
    turning.elf.lines.borrow_mut().rings_after = Some(Nanoseconds(700));
    t4_through_all_tasks(&mut turning);
    let (ringing, more) = turning.worst_since(from);
    println!(
        "{what}: t4 on {:?}, {positions} positions off by {quiet:.2} counts at most, {more} on a line that rings by {ringing:.2}; acknowledged \
         {held_up} behind it at most",
        edge.line
    );
    assert!(positions >= 65 && more >= 65, "{what}: {positions}, {more}");
    assert!(quiet.abs() < 0.5, "{what}: {quiet} counts");
    assert!(ringing.abs() < 0.5, "{what}: {ringing} counts on a line that rings");
    // Or nothing was held up: 5 us are 44 counts.
    let level = matches!(output, InterruptOutput::ActiveLowLevel | InterruptOutput::ActiveHighLevel);
    assert!(!level || held_up > Nanoseconds::from_microseconds(5), "{what}: {held_up}");
    edge.line
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn the_position_in_the_at_is_that_of_the_true_shaft_at_t4_on_either_line_with_either_edge_however_late_it_is_read() {
    use InterruptOutput::{ActiveHighLevel, ActiveHighPulse, ActiveLowLevel, ActiveLowPulse};
    use RoutingSense::{OneIsInt0, ZeroIsInt0};
    let lines = [
        latches_the_true_position(ActiveLowLevel, ZeroIsInt0),
        latches_the_true_position(ActiveHighLevel, OneIsInt0),
        latches_the_true_position(ActiveLowPulse, OneIsInt0),
        latches_the_true_position(ActiveHighPulse, ZeroIsInt0),
    ];
    for line in LINES {
        assert_eq!(lines.iter().filter(|seen| **seen == line).count(), 2, "{lines:?}");
    }
}

/// Counts at which the counters of 16 bits wrap.
const WRAP: u32 = 1 << 16;

/// S-0-0130 to S-0-0133.
fn probe_values(turning: &mut Turning) -> [i32; 4] {
    [130, 131, 132, 133].map(|idn| turning.bench.number(idn) as u32 as i32)
}

/// Arms both probes anew.
fn arm(turning: &mut Turning) {
    for level in [0, 1] {
        for enable in [405, 406] {
            turning.bench.write(enable, Value::Word(level)).unwrap();
        }
    }
}

/// Both probes rise and fall once, each a little before the counters of 16 bits wrap or somewhere else; where the shaft was, as the values come.
fn touch(turning: &mut Turning, before_the_wrap: Option<u32>) -> [u32; 4] {
    if let Some(counts) = before_the_wrap {
        let backwards = turning.bench.rpm() < 0.0;
        let left = |turning: &mut Turning| {
            let moved = turning.count().wrapping_sub(turning.zero) % WRAP;
            if backwards { moved } else { WRAP - moved }
        };
        while !(counts..counts + 250).contains(&left(turning)) {
            turning.bench.run(Nanoseconds::from_microseconds(25));
        }
    }
    let mut counts = [0; 4];
    for (place, count) in counts.iter_mut().enumerate() {
        // The order in which the values stand: 1 rises, 1 falls, 2 rises, 2 falls.
        *count = turning.count();
        turning.bench.drive.motor_side.borrow_mut().change_inputs(|inputs| match place {
            0 => inputs.probe_1 = true,
            1 => inputs.probe_1 = false,
            2 => inputs.probe_2 = true,
            _ => inputs.probe_2 = false,
        });
        turning.bench.run(Nanoseconds(23_457));
    }
    turning.bench.run(Nanoseconds::from_millis(2));
    counts
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn both_edges_of_both_probes_give_the_position_of_the_true_shaft_at_speed_in_both_directions_and_across_the_wrap() {
    let mut turning = Turning::new(fine_press(), 100.0, vec![(Idn(169), Value::Word(0xF))]);
    turning.bench.write(170, Value::Word(3)).unwrap();
    let mut worst = [0.0_f64; 4];
    let mut latched = 0;
    for rpm in [1_000, -1_000] {
        turning.turn(rpm);
        for attempt in 0..10 {
            arm(&mut turning);
            // The supervision asks every 500 us, in which the shaft moves by 4 400 counts.
            let counts = touch(&mut turning, (attempt < 8).then_some(500 + 500 * attempt));
            let values = probe_values(&mut turning);
            for (place, (value, count)) in values.into_iter().zip(counts).enumerate() {
                let deviation = turning.deviation(value, count);
                latched += 1;
                worst[place] = worse(worst[place], deviation);
            }
        }
    }
    println!("{latched} positions, off by {worst:.2?} counts at most");
    assert!(worst.iter().all(|deviation| deviation.abs() < 0.5), "{worst:?}");
}

#[test]
#[ignore = "needs QEMU and the ELF: cargo xtask test"]
fn homing_at_speed_gives_the_index_of_the_true_shaft_the_reference_position_in_both_directions_and_at_the_wrap() {
    for direction in [0, 1] {
        let mut setup = fine_press();
        // The counters of 16 bits begin with the first instructions and wrap eight times in a revolution.
        setup.axis.machine.encoder.index_at = 0.5;
        let parameters = vec![
            (Idn(41), Value::Long(10_000_000)),
            (Idn(42), Value::Long(400_000)),
            (Idn(147), Value::Word(0b10_0000 | direction)),
        ];
        let mut turning = Turning::new(setup, 100.0, parameters);
        let passed = |turning: &mut Turning| {
            let now = turning.bench.world.now().0;
            let mut motor_side = turning.bench.drive.motor_side.borrow_mut();
            (motor_side.machine().index_pulses(now), motor_side.machine().index_count(now))
        };
        let before = passed(&mut turning).0;
        turning.bench.write(148, Value::Word(3)).unwrap();
        let (mut index, mut speed) = (None, 0.0);
        for _ in 0..1_000 {
            if let (pulses, seen @ Some(_)) = passed(&mut turning)
                && index.is_none()
                && pulses != before
            {
                (index, speed) = (seen, turning.bench.rpm());
            }
            turning.bench.run(Nanoseconds::from_millis(1));
            if index.is_some() && turning.bench.rpm().abs() < 1.0 {
                turning.bench.run(Nanoseconds::from_millis(50));
                break;
            }
        }
        let status = turning.bench.number(148);
        assert_eq!(status, 3, "{}", turning.bench.text(0x8003));
        let from = turning.watch_lines();
        turning.bench.run(Nanoseconds::from_millis(100));
        turning.zero = index.unwrap();
        let (worst, positions) = turning.worst_since(from);
        println!("index passed with {speed:.0} rpm: {positions} positions off by {worst:.2} counts at most");
        assert!(positions > 40 && worst.abs() < 0.5, "{worst}");
        assert!(speed.abs() > 150.0 && (speed < 0.0) == (direction == 1), "{speed} rpm");
    }
}
