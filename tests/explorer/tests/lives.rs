//! Lives that once broke a law, lived again, and what the explorer promises of itself.

use explorer::dice::seed_of_life;
use explorer::life::Action;
use explorer::work::told;
use explorer::{Ending, Life, life_of, live};
use std::path::Path;

/// So many of the lives of a seed, for a test that takes seconds.
const LIVES: u64 = 12;

fn lives_in(folder: &str) -> Vec<(String, Life)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut lives: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        .map(|path| {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            let text = std::fs::read_to_string(&path).unwrap();
            (name.clone(), serde_json::from_str(&text).unwrap_or_else(|error| panic!("{name}: {error}")))
        })
        .collect();
    lives.sort_by(|one, other| one.0.cmp(&other.0));
    lives
}

#[test]
fn lives_that_once_broke_a_law_break_none_any_more() {
    let broken: Vec<String> = lives_in("lives")
        .iter()
        .filter_map(|(name, life)| {
            let outcome = live(life);
            // Some axes are refused by now, with a reason: so no law can be broken on them.
            matches!(outcome.ending, Ending::Broken { .. }).then(|| format!("{name}: {}", told(life, &outcome)))
        })
        .collect();
    assert!(broken.is_empty(), "{}", broken.join("\n\n"));
}

/// So that who mends one hears of it, and moves it to the others.
#[test]
fn lives_that_are_left_to_be_mended_break_their_law_still() {
    let left = lives_in("lives/left");
    assert!(!left.is_empty());
    let page = include_str!("../lives/left/README.md");
    for (name, life) in left {
        assert!(page.contains(&format!("| {name} |")), "{name} is not on the page");
        assert!(matches!(live(&life).ending, Ending::Broken { .. }), "{name} breaks no law any more: move it to lives");
    }
}

#[test]
fn the_same_seed_gives_the_same_life_to_the_last_bit() {
    let mut hashes = Vec::new();
    for index in 0..LIVES {
        let life = life_of(seed_of_life(5, index));
        let (once, again) = (live(&life), live(&life));
        assert_eq!(once, again, "{life}");
        hashes.push(once.hash);
    }
    hashes.sort_unstable();
    hashes.dedup();
    assert!(hashes.len() as u64 > LIVES / 2, "different lives leave different traces: {hashes:?}");
}

#[test]
fn a_life_survives_being_written_to_a_file() {
    for index in 0..200 {
        let life = life_of(seed_of_life(9, index));
        let text = serde_json::to_string(&life).unwrap();
        assert_eq!(serde_json::from_str::<Life>(&text).unwrap(), life);
    }
}

#[test]
fn a_life_reads_like_a_sentence() {
    let mut life = life_of(seed_of_life(1, 0));
    life.events.truncate(1);
    let text = life.to_string();
    assert!(text.starts_with("axis ") && text.contains("; CP4; at ") && text.ends_with(" ms more."), "{text}");
    assert_eq!(text.lines().count(), 1);
}

/// Laws that need an axis which rests while nothing disturbs it.
const QUIET_LAWS: [&str; 3] = [
    "what the drive does by itself goes the way that it was told",
    "after homing with a marker, the reference point lies S-0-0150 from it",
    "after the cause is gone, S-0-0099 and a fresh edge always bring the axis back",
];

#[test]
fn lives_that_begin_in_peace_give_every_quiet_law_something_to_look_at() {
    let mut looked = [0; QUIET_LAWS.len()];
    // Homing that is waited for, of an axis that knows its angle, right at the beginning.
    let begins_at_rest = |life: &Life| {
        let begun = life.events.iter().position(|event| matches!(event.action, Action::Start(148)));
        let ended = life.events.iter().position(|event| matches!(event.action, Action::Cancel(148)));
        let waits = |begun: usize, ended: usize| life.events[ended].at >= life.events[begun].at + 400_000;
        life.axis.aligned
            && life.axis.also.is_empty()
            && begun.zip(ended).is_some_and(|(begun, ended)| begun < 8 && waits(begun, ended))
    };
    let lives = (0..2_000).map(|index| life_of(seed_of_life(4, index))).filter(begins_at_rest).take(12);
    for mut life in lives {
        let homed = life.events.iter().position(|event| matches!(event.action, Action::Cancel(148))).unwrap();
        life.events.truncate(homed + 2);
        let outcome = live(&life);
        assert!(!matches!(outcome.ending, Ending::Broken { .. }), "{}", told(&life, &outcome));
        let seen = &outcome.coverage.seen["law looked"];
        for (looked, law) in looked.iter_mut().zip(QUIET_LAWS) {
            *looked += seen[law];
        }
    }
    assert!(looked.iter().all(|looked| *looked > 0), "{looked:?}");
}
