//! The supply goes at every step.

use flash::FlashModel;
use memory::{Condition, Memory};

use crate::{Small, amend, load, save, set, started};

/// Without `SAVES` in the environment; `SAVES=1000` takes three minutes.
const SAVES: u32 = 120;
const LENGTH: usize = 120;

/// What a start finds after a cut: the set of this save, or, where it was not acknowledged, the one before; whole, and the same when it is looked for
/// once more.
fn check_restart(mut flash: Small, number: u32, acknowledged: bool, step: u64) -> Small {
    let of = |number: u32| (number > 0).then(|| set(number, LENGTH));
    flash.0.restore_supply();
    let (mut memory, condition) = started(flash).unwrap();
    assert_ne!(condition, Condition::Damaged, "save {number}, step {step}");
    let found = load(&mut memory);
    let old = || found == of(number.saturating_sub(1));
    assert!(found == of(number) || !acknowledged && old(), "save {number}, step {step}: neither old nor new");
    if step.is_multiple_of(8) {
        let (mut again, condition) = started(memory.flash().clone()).unwrap();
        assert_eq!(load(&mut again), found, "save {number}, step {step}, started twice");
        assert_ne!(condition, Condition::Damaged);
    }
    memory.flash().clone()
}

/// Cuts `act` at those of its operations that are `looked_at` (which one of how many), always from the same beginning.
fn at_each_step(
    before: &Small,
    seed: u64,
    act: impl Fn(Small) -> Small,
    looked_at: impl Fn(u64, u64) -> bool,
    check: impl Fn(Small, u64),
) -> (Small, u64) {
    let after = act(before.clone());
    let steps = after.0.operations() - before.0.operations();
    let mut cuts = 0;
    for step in (1..=steps).filter(|step| looked_at(*step, steps)) {
        let mut flash = before.clone();
        flash.0.cut_in(step, seed.wrapping_mul(1_000_003).wrapping_add(step));
        let cut = act(flash);
        assert!(!cut.0.is_supplied(), "step {step} of {steps} was not cut");
        check(cut, step);
        cuts += 1;
    }
    (after, cuts)
}

#[test]
fn a_cut_at_any_step_of_many_saves_leaves_the_old_set_or_the_new_one() {
    let saves = std::env::var("SAVES").ok().map_or(SAVES, |saves| saves.parse().expect("SAVES is a number of saves"));
    let mut flash = Small(FlashModel::new());
    let (mut cuts, mut turns) = (0, 0);
    for number in 1..=saves {
        // A start, cut as well: that is where pages turn, after some 2 000 words that only fill one up. Of those some will do, but in the first turn of a long run.
        let (after, of_start) = at_each_step(
            &flash,
            number.into(),
            |flash| {
                let mut memory = Memory::new(flash);
                // Where it was cut, it fails.
                let _ = embassy_futures::block_on(memory.start(&mut [0; crate::BUFFER]));
                memory.flash().clone()
            },
            |step, of| saves >= 1_000 && turns < 1 || step < 20 || step + 60 > of || step.is_multiple_of(64),
            |flash, step| {
                check_restart(flash, number - 1, true, step);
            },
        );
        turns += u32::from(of_start > 20);
        let (after, of_save) = at_each_step(
            &after,
            number.into(),
            |flash| {
                let (mut memory, _) = started(flash).unwrap();
                // Every other one is made of the one before.
                let result = if number.is_multiple_of(2) {
                    amend(&mut memory, &set(number - 1, LENGTH), &set(number, LENGTH)).map(|found| assert!(found))
                } else {
                    save(&mut memory, &set(number, LENGTH))
                };
                assert_eq!(result.is_ok(), memory.flash().0.is_supplied(), "what was cut is not acknowledged");
                memory.flash().clone()
            },
            |_, _| true,
            |flash, step| {
                check_restart(flash, number, false, step);
            },
        );
        cuts += of_start + of_save;
        flash = after;
    }
    let flash = check_restart(flash, saves, true, 0);
    let erases: u64 = flash.0.erases().iter().sum();
    println!("{saves} saves, {cuts} cuts, {erases} erases");
    assert!(
        cuts > 40 * u64::from(saves) && turns >= saves / 60 && erases >= u64::from(saves / 60),
        "{cuts} cuts, {turns} turns, {erases} erases"
    );
}
