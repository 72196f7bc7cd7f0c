//! `cargo xtask budget`: what every task takes, counted on the ELF that is flashed, and what it must not contain.

mod gates;
mod profile;
mod response;
mod table;
mod verdict;

pub(crate) use table::Style;

use crate::elf::{Graph, Program};
use crate::progress::PhaseBars;
use crate::setup::Installing;
use crate::{Verdict, firmware, setup};
use anyhow::{Context, Result};
use bench::TraceError;

/// Builds, looks, counts, prints, judges; of a task named, only prints where its instructions go.
pub(crate) fn run(style: Style, profiled: Option<&str>, installing: Installing) -> Result<Verdict> {
    let profiled = profiled.map(task_of).transpose()?;
    // Asked for before the build: a missing QEMU is known at once.
    let version = setup::qemu(installing)?;
    let elves = firmware::build(installing)?;
    let product = std::fs::read(&elves.product).with_context(|| format!("cannot read {}", elves.product.display()))?;
    let graph = Graph::new(Program::parse(&product)?)?;
    let mut listing = verdict::listing(&graph, gates::GATES)?;
    listing.profiled = profiled.and_then(|task| Some(graph.program.vector(task.vector)?.1));
    eprintln!("counting the instructions of the ELF in QEMU {version}");
    let mut bars = PhaseBars::new();
    let traced = bench::traced(&elves, listing, &mut |progress| bars.show(progress));
    bars.finish();
    let traced = match traced {
        Ok(traced) => traced,
        // The run was possible and came to nothing: that is a result.
        Err(failure @ (TraceError::Master(_) | TraceError::TooLate { .. })) => {
            eprintln!("failed: {failure}");
            return Ok(Verdict::Failed);
        }
        Err(error) => return Err(error.into()),
    };
    if let Some(exception) = profiled.and_then(|task| Some(graph.program.vector(task.vector)?.1)) {
        let activations = traced.activations.tasks().get(&exception).map_or(0, |task| task.own.count);
        print!("{}", profile::tree(&elves.product, traced.activations.profile(), activations)?);
        return Ok(Verdict::Passed);
    }
    let report = verdict::judge(&graph, &traced, gates::GATES);
    print!("{}", table::tables(&report, style));
    for failure in &report.failures {
        eprintln!("failed: {failure}");
    }
    Ok(if report.failures.is_empty() { Verdict::Passed } else { Verdict::Failed })
}

fn task_of(name: &str) -> Result<&'static gates::Task> {
    let names = || gates::GATES.tasks.iter().map(|task| task.name).collect::<Vec<_>>().join(", ");
    let task = gates::GATES.tasks.iter().find(|task| task.name == name);
    task.with_context(|| format!("{name} is no task of the application; the tasks are {}", names()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elf::{Check, findings};

    /// The real ELF, which `cargo xtask test` builds.
    fn graph() -> Graph {
        let path = std::env::var_os("PRODUCT_ELF").expect("PRODUCT_ELF is not set: run `cargo xtask test`");
        Graph::new(Program::parse(&std::fs::read(path).unwrap()).unwrap()).unwrap()
    }

    fn root(graph: &Graph, vector: &str) -> usize {
        graph.program.function_at(graph.program.vector(vector).unwrap().0).unwrap()
    }

    #[test]
    #[ignore = "needs the ELF: cargo xtask test"]
    fn every_task_of_the_gates_is_in_the_flashed_elf_with_the_number_of_its_vector() {
        let graph = graph();
        for task in gates::GATES.tasks {
            assert!(graph.program.vector(task.vector).is_some(), "{}", task.vector);
        }
        assert_eq!(graph.program.vector("CAN2_TX").map(|(_, number)| number), Some(16 + 63));
        assert_eq!(graph.program.vector("EXTI0"), None, "the default handler is no task");
    }

    #[test]
    #[ignore = "needs the ELF: cargo xtask test"]
    fn the_checks_see_in_the_flashed_elf_what_is_there() {
        let graph = graph();
        // The reset goes everywhere: it must find everything that there is, or the checks are blind.
        let main = graph.program.functions().iter().position(|function| function.name == "main").unwrap();
        for check in [Check::Panic, Check::Division, Check::MemoryRoutine, Check::Lock] {
            assert!(!findings(&graph, main, check).is_empty(), "{}", check.name());
        }
        // The service channel calls through tables of functions.
        assert!(!findings(&graph, root(&graph, "CAN1_SCE"), Check::IndirectCall).is_empty());
        // The control loop shares its resources by locks.
        assert!(!findings(&graph, root(&graph, "CAN2_TX"), Check::Lock).is_empty());
    }

    #[test]
    #[ignore = "needs the ELF: cargo xtask test"]
    fn no_forbidden_thing_is_reached_from_a_task_of_the_cycle() {
        let graph = graph();
        for task in gates::GATES.tasks {
            for check in task.forbidden {
                let found = findings(&graph, root(&graph, task.vector), *check);
                assert!(found.is_empty(), "{}: {}: {found:?}", task.vector, check.name());
            }
        }
    }
}
