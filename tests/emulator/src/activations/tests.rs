//! Streams of events, and what is counted in them.

use super::*;
use TraceEvent::{Access, Entered, Instruction, Left, Mark};

const CORE: u32 = 0x200;

fn listing() -> Listing {
    Listing {
        steps: HashMap::from([
            (0x104, Step::Call(0x108)),
            (0x10a, Step::Lock),
            (0x110, Step::Unlock),
            (0x204, Step::Call(0x208)),
        ]),
        functions: HashMap::from([(CORE, "core".to_owned())]),
        slow_bus: 0x6000_0000..0x7000_0000,
        price: Price::default(),
        cycle: Some(36),
        profiled: Some(70),
    }
}

fn counted(events: impl IntoIterator<Item = TraceEvent>) -> Activations {
    let mut activations = Activations::new(listing());
    activations.take(Mark);
    events.into_iter().for_each(|event| activations.take(event));
    activations
}

fn run(addresses: impl IntoIterator<Item = u32>) -> Vec<TraceEvent> {
    addresses.into_iter().map(Instruction).collect()
}

fn once(value: u64) -> Spread {
    Spread { count: 1, least: value, most: value, sum: value }
}

#[test]
fn what_interrupts_a_task_is_not_its_own() {
    let count = counted(
        [
            vec![Entered(70)],
            run([0x100, 0x102]),
            vec![Entered(34)],
            run([0x300, 0x302]),
            vec![Entered(35), Instruction(0x600), Left(35)],
            run([0x304]),
            vec![Left(34)],
            run([0x106]),
            vec![Left(70)],
        ]
        .concat(),
    );
    assert_eq!((count.tasks()[&70].own, count.tasks()[&70].with_preemption), (once(3), once(7)));
    assert_eq!((count.tasks()[&34].own, count.tasks()[&34].with_preemption), (once(3), once(4)));
    assert_eq!(count.executed(), 7);
}

#[test]
fn two_activations_one_behind_the_other_are_two() {
    let count = counted(
        [vec![Entered(70)], run([0x100]), vec![Left(70), Entered(70)], run([0x100, 0x102]), vec![Left(70)]].concat(),
    );
    assert_eq!(count.tasks()[&70].own, Spread { count: 2, least: 1, most: 2, sum: 3 });
    assert_eq!(count.tasks()[&70].own.mean(), 2);
}

#[test]
fn a_function_counts_with_what_it_calls_and_without_what_interrupts_it() {
    let count = counted(
        [
            vec![Entered(70)],
            run([0x100, 0x104, CORE, 0x204, 0x400, 0x402]),
            vec![Entered(34)],
            run([0x300]),
            vec![Left(34)],
            run([0x208, 0x20a, 0x108, 0x106]),
            vec![Left(70)],
        ]
        .concat(),
    );
    // 200, 204, the callee's 400 and 402, 208, 20a.
    assert_eq!(count.functions()["core"], once(6));
}

#[test]
fn the_profile_has_every_instruction_of_its_task_below_the_calls_that_led_there() {
    let count = counted(
        [
            vec![Entered(70)],
            run([0x100, 0x104, CORE, 0x202]),
            vec![Entered(34), Instruction(0x202), Left(34)],
            run([0x202, 0x108]),
            vec![Left(70), Entered(70)],
            run([0x100]),
            vec![Left(70)],
        ]
        .concat(),
    );
    let expected = Profile::from([
        (vec![], HashMap::from([(0x100, 2), (0x104, 1), (0x108, 1)])),
        (vec![0x108], HashMap::from([(CORE, 1), (0x202, 2)])),
    ]);
    assert_eq!(count.profile(), &expected);
}

#[test]
fn a_function_that_ends_with_a_jump_returns_where_its_caller_was_called() {
    // 104 calls 500, which jumps to CORE, which returns to 108.
    let count = counted([vec![Entered(70)], run([0x104, 0x500, CORE, 0x202, 0x108]), vec![Left(70)]].concat());
    assert_eq!(count.functions()["core"], once(2));
}

#[test]
fn a_function_that_a_handler_jumps_to_ends_with_the_handler_and_a_loop_does_not_begin_it_anew() {
    let count = counted([vec![Entered(70)], run([0x100, CORE, 0x202, CORE, 0x202]), vec![Left(70)]].concat());
    assert_eq!(count.functions()["core"], once(4));
}

#[test]
fn nested_critical_sections_are_one_and_the_last_restore_of_a_task_is_none() {
    let count =
        counted([vec![Entered(70)], run([0x100, 0x10a, 0x10a, 0x10c, 0x110, 0x110, 0x110]), vec![Left(70)]].concat());
    // From behind the first lock: lock, 10c, unlock, unlock.
    assert_eq!(count.tasks()[&70].locked, once(4));
}

#[test]
fn what_ran_at_one_mark_is_forgotten_at_the_next() {
    let count =
        counted([vec![Entered(70)], run([0x100]), vec![Mark, Mark], run([0x102]), vec![Left(70), Mark]].concat());
    assert!(count.tasks().is_empty(), "{:?}", count.tasks());
}

#[test]
fn a_critical_section_of_the_thread_is_known_after_the_second_mark() {
    let count = counted([run([0x10a, 0x10c, 0x110]), vec![Mark]].concat());
    assert_eq!(count.thread().locked, once(2));
}

#[test]
fn an_activation_belongs_to_the_cycle_in_which_it_began() {
    let twice = |address| [vec![Entered(34)], run([address, 0x302]), vec![Left(34)]].concat();
    let count = counted(
        [
            // One before the first cycle, three in it, of which the last is interrupted by its end, and one in the second.
            twice(0x300),
            vec![Entered(36), Instruction(0x700), Left(36)],
            twice(0x300),
            twice(0x300),
            vec![Entered(34), Instruction(0x300), Entered(36), Instruction(0x700), Left(36)],
            run([0x302, 0x304, 0x306]),
            vec![Left(34)],
            twice(0x300),
        ]
        .concat(),
    );
    let worst = count.tasks()[&34].worst;
    assert_eq!(worst.cycle, Demand { activations: 3, instructions: 8, bus: 0 });
    assert_eq!(worst.activation, Demand { activations: 1, instructions: 4, bus: 0 });
    assert_eq!(count.tasks()[&36].worst.cycle, Demand { activations: 1, instructions: 1, bus: 0 });
}

#[test]
fn instructions_and_accesses_of_the_worst_are_those_of_one_activation_and_of_one_section() {
    let locked = |body: Vec<TraceEvent>| [vec![Instruction(0x10a)], body, vec![Instruction(0x110)]].concat();
    let mut listing = listing();
    listing.price = Price { core_megahertz: 168, bus_access: 550 };
    let mut count = Activations::new(listing);
    let access = vec![Instruction(0x100), Access(0x6000_0012)];
    let events = [
        vec![Mark, Entered(70)],
        locked(run(0x120..0x140)),
        vec![Left(70), Entered(70)],
        locked(access),
        vec![Left(70)],
    ];
    events.concat().into_iter().for_each(|event| count.take(event));
    let task = count.tasks()[&70];
    assert_eq!((task.own.most, task.bus.most, task.locked.most, task.bus_locked.most), (34, 1, 33, 1));
    assert_eq!(task.worst.activation, Demand { activations: 1, instructions: 3, bus: 1 });
    assert_eq!(task.worst.lock, Demand { activations: 0, instructions: 2, bus: 1 });
}

#[test]
fn only_accesses_to_the_slow_bus_are_counted() {
    let count = counted(
        [
            vec![Entered(70), Instruction(0x100), Access(0x6000_0012)],
            vec![Instruction(0x102), Access(0x4000_1010)],
            vec![Left(70)],
        ]
        .concat(),
    );
    assert_eq!((count.tasks()[&70].bus, count.tasks()[&70].own), (once(1), once(2)));
}

#[test]
fn only_activations_that_lie_wholly_between_the_marks_count() {
    let count = counted(
        [
            // Began before the mark.
            run([0x100]),
            vec![Entered(34)],
            run([0x300]),
            vec![Left(34)],
            run([0x102]),
            vec![Left(70), Entered(70)],
            run([0x100]),
            vec![Left(70), Entered(70)],
            run([0x100]),
            vec![Mark],
            run([0x102]),
            vec![Left(70)],
        ]
        .concat(),
    );
    assert_eq!((count.tasks()[&70].own, count.tasks()[&34].own), (once(1), once(1)));
    assert_eq!(count.executed(), 5);
}
