//! A worker of `cargo xtask explore`: `lives RUN FROM COUNT [KNOWN LAW]..`, `life SEED`, `shrink SEED`, `replay FILE`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

use explorer::work::{TRIALS, lives, told};
use explorer::{Ending, Life, life_of, live, shrink};

fn main() -> ExitCode {
    // A panic is a broken law and told as such.
    std::panic::set_hook(Box::new(|_| {}));
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match work(&words) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// Whether no law is broken.
fn work(words: &[&str]) -> Result<bool, String> {
    let number = |text: &str| match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).map_err(|error| format!("{text}: {error}")),
        None => text.parse::<u64>().map_err(|error| format!("{text}: {error}")),
    };
    match words {
        ["lives", run, from, count, known @ ..] => {
            let known: Vec<String> = known.iter().map(|&law| law.to_owned()).collect();
            let mut out = std::io::stdout().lock();
            lives(number(run)?, number(from)?, number(count)?, &known, &mut out).map_err(|error| error.to_string())?;
            Ok(true)
        }
        ["life", seed] => Ok(tell(&life_of(number(seed)?))),
        ["shrink", seed] => {
            let life = shrink(&life_of(number(seed)?), TRIALS);
            println!("{}", serde_json::to_string(&life).map_err(|error| error.to_string())?);
            Ok(tell(&life))
        }
        ["replay", file] => {
            let text = std::fs::read_to_string(file).map_err(|error| format!("cannot read {file}: {error}"))?;
            let life: Life = serde_json::from_str(&text).map_err(|error| format!("{file} is no life: {error}"))?;
            Ok(tell(&life))
        }
        _ => Err("expected lives RUN FROM COUNT, life SEED, shrink SEED or replay FILE".to_owned()),
    }
}

fn tell(life: &Life) -> bool {
    let outcome = live(life);
    println!("{}", told(life, &outcome));
    !matches!(outcome.ending, Ending::Broken { .. })
}
