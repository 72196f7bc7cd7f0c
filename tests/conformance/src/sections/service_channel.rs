//! Elements, lengths, limits, errors, and dialogues that break off.

use ring::ident::{Element, Idn};
use ring::service_client::{Step, status};
use sercos::Phase;

use crate::case::{Case, Section, ensure, expect};
use crate::configuration::{Configuration, list};
use crate::slave::{Outcome, Slave};
use crate::walk;

const SECTION: Section = Section::ServiceChannel;

/// Data of every length that the service channel has: two values that are legal in CP2.
const LENGTHS: [(u16, &str, [&[u16]; 2]); 6] = [
    (2, "2 bytes", [&[1_000], &[65_000]]),
    (79, "4 bytes", [&[0x1234, 0x0056], &[1, 0]]),
    (142, "1-byte items", [&[5, 5, 0x7270, 0x7365, 0x0073], &[2, 2, 0x4141]]),
    (16, "2-byte items of IDNs", [&[6, 6, 11, 51, 0x8013], &[0, 0]]),
    (328, "2-byte items of numbers", [&[4, 4, 15, 0], &[2, 2, 7]]),
    (0x8007, "4-byte items", [&[8, 8, 1, 2, 3, 4], &[4, 4, 0xFFFF, 0xFFFF]]),
];

pub(super) fn cases() -> Vec<Case> {
    [elements(), limits(), protection(), lengths(), dialogues(), handshake(), walks()].into_iter().flatten().collect()
}

fn elements() -> Vec<Case> {
    let mut cases = Vec::new();
    for (idn, what, values) in LENGTHS {
        let rule = format!("{}, {what}: what is written reads back", Idn(idn));
        cases.push(Case::new(SECTION, rule, "IGS 4.2.2.1 e, f", move |slave| {
            slave.to_cp2()?;
            for words in values {
                slave.must_set(idn, words)?;
                let read = slave.get(idn)?;
                // The second length word is the drive's own maximum.
                let own = if is_list(idn) { [&[words[0], read[1]], &words[2..]].concat() } else { words.to_vec() };
                expect("operation data", read, own)?;
            }
            Ok(())
        }));
    }
    for phase in 2..=4 {
        let rule = format!("CP{phase}: all seven elements of S-0-0002 and S-0-0016");
        cases.push(Case::new(SECTION, rule, "IGS 4.2.2.1 a", move |slave| {
            slave.run_up(phase, Configuration::application(&[51], &[36]))?;
            slave.open(2)?;
            expect("element 1", slave.words(1, 1)?, Ok(vec![2]))?;
            expect("name", slave.list(2)?.map(|words| words.len() > 10), Ok(true))?;
            expect("attribute", slave.words(3, 2)?, Ok(vec![0x0001, 0x6011]))?;
            expect("unit", slave.list(4)?, Ok(vec![2, 2, u16::from_le_bytes(*b"us")]))?;
            expect("minimum", slave.words(5, 1)?, Ok(vec![500]))?;
            expect("maximum", slave.words(6, 1)?, Ok(vec![65_000]))?;
            expect("operation data", slave.words(7, 1)?, Ok(vec![2_000]))?;
            slave.open(16)?;
            expect("attribute", slave.words(3, 2)?, Ok(vec![0x0001, 0x6055]))?;
            for (element, code) in [(4, 0x4001), (5, 0x5001), (6, 0x6001)] {
                expect("an element that the list does not have", slave.words(element, 1)?, Err(code))?;
            }
            expect("operation data", slave.list(7)?, Ok(vec![2, 32, 51]))
        }));
    }
    cases.push(Case::new(
        SECTION,
        "minimum and maximum have the length of the operation data",
        "sercos2.md 3.1",
        |slave| {
            slave.to_cp2()?;
            slave.open(79)?;
            expect("minimum", slave.words(5, 2)?, Ok(vec![1, 0]))?;
            expect("maximum", slave.words(6, 2)?, Ok(vec![0xFFFF, 0xFFFF]))
        },
    ));
    cases.push(Case::new(SECTION, "a list over several buffers arrives whole: S-0-0017", "sercos2.md 3.2", |slave| {
        slave.to_cp2()?;
        let all = slave.entries(17)?;
        let table: Vec<u16> = drive::DICTIONARY.blocks().iter().map(|block| block.idn.0).collect();
        expect("S-0-0017", all, table)
    }));
    cases.push(Case::new(SECTION, "a long text arrives whole: P-0-0010", "sercos2.md 3.2", |slave| {
        slave.to_cp2()?;
        slave.mst = Some(4);
        slave.cycles(5);
        slave.to_cp2()?;
        let cause = slave.text(0x800A)?;
        ensure(cause.len() > 40 && cause.ends_with('.'), || format!("{cause:?}"))
    }));
    cases.push(Case::new(
        SECTION,
        "the open answers with the data status: 0 for a parameter",
        "sercos2.md 3.4",
        |slave| {
            slave.to_cp2()?;
            for idn in [2, 16, 95, 17] {
                expect("data status", slave.open(idn)?, 0)?;
            }
            Ok(())
        },
    ));
    for idn in [0_u16, 31, 4_095, 0x1002, 0x8000, 0x8FFF, 0xFFFF] {
        let rule = format!("{} does not exist: 1001H, and the channel is closed", Idn(idn));
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5", move |slave| {
            slave.to_cp2()?;
            slave.open(2)?;
            expect("open", slave.step(Step::open(Idn(idn)))?.result(), Err(0x1001))?;
            expect("read", slave.words(7, 1)?, Err(0x0001))
        }));
    }
    cases
}

fn limits() -> Vec<Case> {
    let mut cases = Vec::new();
    // IDN, words, answer.
    let rows: [(u16, &'static [u16], Result<(), u16>); 21] = [
        (2, &[500], Ok(())),
        (2, &[499], Err(0x7006)),
        (2, &[65_000], Ok(())),
        (2, &[65_001], Err(0x7007)),
        (1, &[800], Err(0x7008)),
        (2, &[800], Err(0x7008)),
        (2, &[2_100], Err(0x7008)),
        (6, &[11], Err(0x7006)),
        (6, &[12], Ok(())),
        (9, &[0], Err(0x7006)),
        (10, &[65_535], Err(0x7007)),
        (79, &[0, 0], Err(0x7006)),
        (79, &[0xFFFF, 0xFFFF], Ok(())),
        (46, &[0xFFDF], Err(0x7006)),
        (46, &[0xFFE0], Ok(())),
        (46, &[33], Err(0x7007)),
        (57, &[0xFFFF, 0xFFFF], Err(0x7006)),
        (265, &[2], Err(0x7007)),
        (269, &[2], Err(0x7007)),
        (413, &[16], Err(0x7007)),
        (99, &[2], Err(0x7008)),
    ];
    for (idn, words, answer) in rows {
        let verdict = answer.map_or_else(|code| format!("refused with {code:04X}H"), |()| "taken".to_owned());
        let rule = format!("{} = {words:04X?} is {verdict}", Idn(idn));
        cases.push(Case::new(SECTION, rule, "IGS 4.2.2.1 f, 4.2.2.2 b", move |slave| {
            slave.to_cp2()?;
            let before = slave.get(idn)?;
            expect("answer", slave.set(idn, words)?, answer)?;
            expect("operation data", slave.get(idn)?, if answer.is_ok() { words.to_vec() } else { before })
        }));
    }
    cases
}

fn protection() -> Vec<Case> {
    let mut cases = Vec::new();
    for idn in [3_u16, 11, 17, 30, 51, 96, 135, 187, 390, 0x8001] {
        let rule = format!("{} is read-only: 7004H in every phase", Idn(idn));
        cases.push(Case::new(SECTION, rule, "IGS 4.2.2.2 a", move |slave| {
            for phase in 2..=4 {
                slave.run_up(phase, Configuration::default())?;
                expect("answer", slave.set(idn, &[0])?, Err(0x7004))?;
            }
            Ok(())
        }));
    }
    for element in 2..=6 {
        let rule = format!("element {element} cannot be written: {element}004H, or {element}001H where there is none");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.1, 3.5", move |slave| {
            slave.to_cp2()?;
            slave.open(2)?;
            let answer = slave.send(element, true, true, 0)?.result();
            expect("S-0-0002", answer, Err(u16::from(element) << 12 | 4))?;
            slave.open(16)?;
            let missing = if element >= 4 { 1 } else { 4 };
            let answer = slave.send(element, true, true, 0)?.result();
            expect("S-0-0016", answer, Err(u16::from(element) << 12 | missing))
        }));
    }
    for (idn, words, phases) in [
        (2, vec![4_000], [true, false, false]),
        (32, vec![2], [true, true, false]),
        (104, vec![120], [true, true, true]),
        (16, list(&[51]), [true, false, false]),
        (128, vec![0], [false, true, false]),
        (148, vec![0], [false, false, true]),
    ] {
        let rule = format!("{} can be written in {}", Idn(idn), phases_of(phases));
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.7, 4", move |slave| {
            for (phase, may) in (2..=4).zip(phases) {
                slave.run_up(phase, Configuration::default())?;
                expect(&format!("CP{phase}"), slave.set(idn, &words)?, if may { Ok(()) } else { Err(0x7005) })?;
            }
            Ok(())
        }));
    }
    for phase in [3, 4] {
        let rule = format!("CP{phase}: what the MDT carries is refused with 700AH, what it does not is taken");
        cases.push(Case::new(SECTION, rule, "sercos2.md 1.9", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            expect("S-0-0036", slave.set(36, &[1, 0])?, Err(0x700A))?;
            expect("S-0-0047", slave.set(47, &[1, 0])?, Ok(()))
        }));
    }
    for idn in [400, 405, 406, 407] {
        let rule = format!("S-0-{idn:04} is not written past the control bit that sets it: 700CH");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5, 6.1", move |slave| {
            slave.run_up(4, Configuration::default())?;
            slave.must_set(idn, &[1])?;
            slave.must_set(idn, &[0])?;
            slave.must_set(301, &[idn])?;
            for (control, owned) in [(0, 0), (1 << 6, 1)] {
                slave.control = control;
                slave.cycles(3);
                expect("operation data", slave.number(idn)?, owned.into())?;
                expect("another value", slave.set(idn, &[1 - owned])?, Err(0x700C))?;
                expect("what is there", slave.set(idn, &[owned])?, Ok(()))?;
                expect("operation data", slave.number(idn)?, owned.into())?;
            }
            slave.must_set(301, &[0])?;
            slave.must_set(idn, &[0])?;
            expect("operation data, free again", slave.number(idn)?, 0)
        }));
    }
    cases.push(Case::new(
        SECTION,
        "P-0-0019: only the bits that no control bit and no signal bit sets are written, 700CH for the others",
        "sercos2.md 3.5, 6.1",
        |slave| {
            let signals = Configuration::application(&[51], &[36, 145]).with(27, &[2, 2, 0x8013]).with(329, &[2, 2, 4]);
            slave.run_up(4, signals.with(301, &[0x8013]).with(413, &[3]))?;
            slave.commands = vec![0; 6];
            slave.cycles(3);
            expect("a free bit", slave.set(0x8013, &[1])?, Ok(()))?;
            expect("bit 3, of the control word", slave.set(0x8013, &[9])?, Err(0x700C))?;
            expect("bit 4, of S-0-0145", slave.set(0x8013, &[0x11])?, Err(0x700C))?;
            slave.control = 1 << 6;
            slave.commands[4] = 1;
            slave.cycles(3);
            expect("operation data", slave.number(0x8013)?, 0x19)?;
            expect("bit 3 cleared", slave.set(0x8013, &[0x11])?, Err(0x700C))?;
            expect("the others", slave.set(0x8013, &[0x8018])?, Ok(()))?;
            slave.cycles(3);
            expect("operation data", slave.number(0x8013)?, 0x8018)
        },
    ));
    cases.push(Case::new(
        SECTION,
        "S-0-0400 is the switch at the drive with S-0-0147 bit 2, and what is written without it",
        "sercos2.md 6.4",
        |slave| {
            slave.run_up(4, Configuration::default().with(147, &[0x64]))?;
            for level in [false, true] {
                slave.drive.motor_side.borrow_mut().change_inputs(|inputs| inputs.home_switch = level);
                slave.cycles(5);
                expect("operation data", slave.number(400)?, level.into())?;
                expect("another value", slave.set(400, &[u16::from(!level)])?, Err(0x700C))?;
                expect("what is there", slave.set(400, &[level.into()])?, Ok(()))?;
            }
            slave.must_set(147, &[0x60])?;
            slave.must_set(400, &[0])?;
            expect("written, with the input set", slave.number(400)?, 0)?;
            slave.must_set(400, &[1])?;
            expect("written", slave.number(400)?, 1)
        },
    ));
    for (idn, words, culprit) in [
        (201, &[1_400][..], "S-0-0201"),
        (204, &[1_100], "S-0-0201"),
        (193, &[1, 0], "S-0-0193"),
        (349, &[1, 0], "S-0-0349"),
    ] {
        let rule = format!(
            "in operation S-0-{idn:04} = {words:?}, which the loops cannot take, is refused: 7008H, and says why"
        );
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5", move |slave| {
            super::error_handling::in_operation(slave, 1, Configuration::application(&[84], &[80]))?;
            let before = slave.get(idn)?;
            expect("answer", slave.set(idn, words)?, Err(0x7008))?;
            expect("operation data", slave.get(idn)?, before)?;
            let finding = slave.text(0x8003)?;
            ensure(finding.starts_with(culprit) && finding.len() > 30, || format!("P-0-0003: {finding:?}"))?;
            // The next write is taken, and in effect: 50 % are asked for, 10 % come.
            slave.must_set(92, &[100])?;
            expect("P-0-0003 after a success", slave.text(0x8003)?, String::new())?;
            slave.commands = 500_i16.to_le_bytes().to_vec();
            slave.cycles(10);
            let torque = slave.number(84)?;
            ensure((90..=110).contains(&torque), || format!("S-0-0084 = {torque} with S-0-0092 = 100"))
        }));
    }
    cases.push(Case::new(
        SECTION,
        "S-0-0267 locks what S-0-0279 lists: 7009H, until the password comes again",
        "sercos2.md 3.5",
        |slave| {
            slave.to_cp2()?;
            let password = [5, 5, u16::from_le_bytes(*b"pr"), u16::from_le_bytes(*b"es"), u16::from(b's')];
            slave.must_set(267, &password)?;
            let locked = slave.entries(279)?;
            ensure(locked.contains(&104) && !locked.contains(&2), || format!("S-0-0279: {locked:?}"))?;
            expect("S-0-0104", slave.set(104, &[120])?, Err(0x7009))?;
            expect("S-0-0002", slave.set(2, &[1_000])?, Ok(()))?;
            expect("a wrong password", slave.set(267, &[2, 2, 0x4141])?, Err(0x7008))?;
            slave.must_set(267, &password)?;
            expect("S-0-0104", slave.set(104, &[120])?, Ok(()))
        },
    ));
    cases
}

fn lengths() -> Vec<Case> {
    let mut cases = Vec::new();
    for (idn, what, values) in LENGTHS {
        let words = values[0];
        let rule = format!("{}, {what}: END too early is 7002H, a word too many 7003H, and nothing changes", Idn(idn));
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.4, 3.5", move |slave| {
            slave.to_cp2()?;
            let before = slave.get(idn)?;
            for end in 1..words.len() {
                expect(&format!("END with word {end}"), slave.set(idn, &words[..end])?, Err(0x7002))?;
            }
            let long = [words, &[0]].concat();
            expect("a word too many", slave.set(idn, &long)?, Err(0x7003))?;
            expect("operation data", slave.get(idn)?, before)
        }));
        let rule = format!("{}, {what}: reading ends too early with 7002H, too late with 7003H", Idn(idn));
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.4, 3.5", move |slave| {
            slave.to_cp2()?;
            slave.must_set(idn, words)?;
            slave.open(idn)?;
            for end in 1..words.len() {
                expect(&format!("END with word {end}"), slave.words(7, end)?, Err(0x7002))?;
            }
            expect("a word too many", slave.words(7, words.len() + 1)?, Err(0x7003))?;
            expect("the right number", slave.words(7, words.len())?.map(|read| read.len()), Ok(words.len()))
        }));
    }
    for element in [2_u8, 3, 4, 5] {
        let rule = format!("element {element}: reading ends too early with {element}002H, too late with {element}003H");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5", move |slave| {
            slave.to_cp2()?;
            // Four-byte data with a unit of three characters.
            slave.open(91)?;
            let words = match element {
                3 | 5 => 2,
                _ => slave.list(element)?.map_or(0, |words| words.len()),
            };
            let code = |low: u16| Err(u16::from(element) << 12 | low);
            for end in 1..words {
                expect(&format!("END with word {end} of {words}"), slave.words(element, end)?, code(2))?;
            }
            expect("a word too many", slave.words(element, words + 1)?, code(3))
        }));
    }
    cases.push(Case::new(SECTION, "END anywhere in a list of several buffers is 7002H", "sercos2.md 3.4", |slave| {
        slave.to_cp2()?;
        slave.open(17)?;
        let words = slave.list(7)?.map_or(0, |words| words.len());
        ensure(words > 100, || format!("{words} words"))?;
        for end in 1..words {
            expect(&format!("END with word {end} of {words}"), slave.words(7, end)?, Err(0x7002))?;
        }
        Ok(())
    }));
    for (idn, words, code, what) in [
        (16, vec![34, 34, 51], 0x7003, "a length beyond the drive's maximum"),
        (16, vec![3, 3, 51, 51], 0x7008, "one and a half items of 2 bytes"),
        (0x8007, vec![6, 6, 1, 2, 3], 0x7008, "one and a half items of 4 bytes"),
        (142, vec![41, 41], 0x7003, "a text of 41 characters"),
        (142, vec![0xFFFF, 0xFFFF], 0x7003, "a length of 65535"),
    ] {
        let rule = format!("{}: {what} is refused with {code:04X}H", Idn(idn));
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.2, 3.5", move |slave| {
            slave.to_cp2()?;
            let before = slave.get(idn)?;
            expect("answer", slave.set(idn, &words)?, Err(code))?;
            expect("operation data", slave.get(idn)?, before)
        }));
    }
    cases.push(Case::new(
        SECTION,
        "S-0-0001 reads as S-0-0002 until the master writes it, and again in the next run-up",
        "sercos2.md 2.3",
        |slave| {
            slave.to_cp2()?;
            slave.must_set(2, &[4_000])?;
            expect("S-0-0001", slave.number(1)?, 4_000)?;
            slave.must_set(1, &[8_000])?;
            slave.must_set(2, &[1_000])?;
            expect("S-0-0001, written", slave.number(1)?, 8_000)?;
            slave.to_cp2()?;
            expect("S-0-0001 in the next CP2", slave.number(1)?, 1_000)
        },
    ));
    let rule = "S-0-0208 takes the value that it has, as from a backup, and no other: 7007H";
    cases.push(Case::new(SECTION, rule, "sercos2.md Appendix A", |slave| {
        for phase in 2..=4 {
            slave.run_up(phase, Configuration::default())?;
            expect("its own", slave.set(208, &[0])?, Ok(()))?;
            expect("a higher one", slave.set(208, &[1])?, Err(0x7007))?;
            expect("operation data", slave.number(208)?, 0)?;
        }
        Ok(())
    }));
    let rule = "S-0-0269 takes both storage modes in every phase, and nothing above";
    cases.push(Case::new(SECTION, rule, "sercos2.md Appendix A", |slave| {
        for phase in 2..=4 {
            slave.run_up(phase, Configuration::default())?;
            for mode in [0, 1] {
                expect("a storage mode", slave.set(269, &[mode])?, Ok(()))?;
                expect("operation data", slave.number(269)?, mode.into())?;
            }
            expect("no storage mode", slave.set(269, &[2])?, Err(0x7007))?;
        }
        Ok(())
    }));
    cases.push(Case::new(SECTION, "the master's idea of the maximum length is ignored", "sercos2.md 3.2", |slave| {
        slave.to_cp2()?;
        for maximum in [0, 2, 32, 0xFFFF] {
            slave.must_set(16, &[4, maximum, 51, 40])?;
            expect("S-0-0016", slave.get(16)?, vec![4, 32, 51, 40])?;
        }
        Ok(())
    }));
    cases
}

fn dialogues() -> Vec<Case> {
    let mut cases = Vec::new();
    cases.push(Case::new(SECTION, "element 1 read on a closed channel: 0001H", "sercos2.md 3.5", |slave| {
        slave.to_cp2()?;
        expect("answer", slave.send(1, false, true, 2)?.result(), Err(0x0001))
    }));
    for element in 2..=7 {
        let rule = format!("element {element} on a closed channel: 0001H");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.5", move |slave| {
            slave.to_cp2()?;
            for write in [false, true] {
                expect("answer", slave.send(element, write, true, 0)?.result(), Err(0x0001))?;
            }
            Ok(())
        }));
    }
    for (write, end) in [(false, false), (false, true), (true, false), (true, true)] {
        let rule = format!("element 0 with L/S = {}, END = {} closes without an error", u8::from(write), u8::from(end));
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.1", move |slave| {
            slave.to_cp2()?;
            for info in [0, 2, 0xFFFF] {
                slave.open(2)?;
                let step = Step { element: Element::Close, write, end, info };
                expect("answer", slave.step(step)?.error, false)?;
                expect("read", slave.words(7, 1)?, Err(0x0001))?;
            }
            Ok(())
        }));
    }
    cases.push(Case::new(SECTION, "element 1 is written without END: 1009H", "sercos2.md 3.5", |slave| {
        slave.to_cp2()?;
        expect("without END", slave.send(1, true, false, 2)?.result(), Err(0x1009))
    }));
    type Interruption = (&'static str, fn(&mut Slave) -> Outcome);
    let interruptions: [Interruption; 6] = [
        ("another element", |slave| slave.words(3, 2).map(|_| ())),
        ("the other direction", |slave| slave.words(7, 2).map(|_| ())),
        ("the same IDN opened again", |slave| slave.open(79).map(|_| ())),
        ("another IDN and back", |slave| {
            slave.open(2)?;
            slave.open(79).map(|_| ())
        }),
        ("a close and an open", |slave| {
            slave.close()?;
            slave.open(79).map(|_| ())
        }),
        ("an unknown IDN and an open", |slave| {
            slave.step(Step::open(Idn(4_000)))?;
            slave.open(79).map(|_| ())
        }),
    ];
    for (what, interrupt) in interruptions {
        let rule = format!("a write broken off by {what} changes nothing, and the next is whole");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.4", move |slave| {
            slave.to_cp2()?;
            let before = slave.get(79)?;
            slave.open(79)?;
            expect("first word", slave.send(7, true, false, 0x1111)?.error, false)?;
            interrupt(slave)?;
            expect("operation data", slave.words(7, 2)?, Ok(before))?;
            expect("whole write", slave.write(&[0x2222, 0x0033])?, Ok(0))?;
            expect("operation data", slave.words(7, 2)?, Ok(vec![0x2222, 0x0033]))
        }));
        let rule = format!("a read broken off by {what} begins anew");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.4", move |slave| {
            slave.to_cp2()?;
            slave.must_set(79, &[0x4444, 0x0055])?;
            slave.open(79)?;
            expect("first word", slave.send(7, false, false, 0)?.result(), Ok(0x4444))?;
            if what == "the other direction" {
                expect("a whole write", slave.write(&[0x4444, 0x0055])?, Ok(0))?;
            } else {
                interrupt(slave)?;
            }
            expect("operation data", slave.words(7, 2)?, Ok(vec![0x4444, 0x0055]))
        }));
    }
    cases.push(Case::new(
        SECTION,
        "after an error in a transfer the rest of it is refused alike, the next is not",
        "sercos2.md 3.5",
        |slave| {
            slave.to_cp2()?;
            slave.open(11)?;
            for end in [false, false, true] {
                expect("read-only", slave.send(7, true, end, 0)?.result(), Err(0x7004))?;
            }
            expect("operation data", slave.words(7, 1)?, Ok(vec![0]))
        },
    ));
    for (from, to) in [(2, 3), (3, 4)] {
        let rule = format!("the open channel and a transfer survive CP{from} to CP{to}");
        cases.push(Case::new(SECTION, rule, "sercos2.md 2.1", move |slave| {
            slave.run_up(from, Configuration::default())?;
            let check = if from == 2 { 127 } else { 128 };
            expect("check", slave.command(check)?, 3)?;
            slave.open(79)?;
            let first = slave.send(7, false, false, 0)?.result();
            slave.mst = Some(to);
            slave.cycles(5);
            let second = slave.send(7, false, true, 0)?.result();
            expect("both words", (first, second), (Ok(0xEE80), Ok(0x0036)))
        }));
    }
    cases
}

fn handshake() -> Vec<Case> {
    let mut cases = Vec::new();
    for phase in 2..=4 {
        let rule = format!("CP{phase}: words within an element take a cycle each, no step more than 10");
        cases.push(Case::new(SECTION, rule, "IGS 4.2.2", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            slave.open(17)?;
            for word in 0..60 {
                let answer = slave.send(7, false, false, 0)?;
                expect(&format!("cycles of word {word}"), answer.cycles, 1)?;
            }
            ensure(slave.slowest.0 <= 10, || format!("{:?}", slave.slowest))
        }));
        let rule = format!("CP{phase}: an MDT without a new MHS is no step");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.3", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            slave.open(2)?;
            let first = slave.last.clone().ok_or("no AT")?;
            slave.force(slave.handshake(), Step { element: Element::Data, write: true, end: true, info: 3_333 });
            for _ in 0..10 {
                let at = slave.cycle().ok_or("no AT")?;
                expect("handshake, BUSY, error, INFO", (at.status & 7, at.info), (first.status & 7, first.info))?;
            }
            slave.open(2)?;
            expect("S-0-0002", slave.words(7, 1)?, Ok(vec![2_000]))
        }));
        let rule = format!("CP{phase}: BUSY is never set with AHS unlike MHS and a new answer");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.3", move |slave| {
            slave.run_up(phase, Configuration::default())?;
            for idn in [2, 17, 95, 142] {
                slave.get(idn)?;
                let at = slave.last.clone().ok_or("no AT")?;
                expect("AHS", at.status & status::HANDSHAKE != 0, slave.handshake())?;
                expect("BUSY", at.status & status::BUSY, 0)?;
            }
            Ok(())
        }));
    }
    cases.push(Case::new(
        SECTION,
        "the word of another drive (element 0, the other handshake) is followed",
        "sercos2.md 2.1",
        |slave| {
            slave.to_cp2()?;
            for handshake in [true, true, false, false, false, true, false] {
                slave.force(handshake, Step { element: Element::Close, write: true, end: true, info: 17 });
                slave.await_answer()?;
            }
            expect("S-0-0096", slave.number(96)?, 0x0505)
        },
    ));
    cases
}

fn walks() -> Vec<Case> {
    let mut cases = Vec::new();
    for (number, phase) in [(2, Phase::Cp2), (3, Phase::Cp3), (4, Phase::Cp4)] {
        let rule =
            format!("CP{number}: every element of every data block reads as the table says, in 10 cycles a step");
        cases.push(Case::new(SECTION, rule, "sercos2.md 3.1, 4", move |slave| {
            slave.run_up(number, Configuration::default())?;
            walk::read_all(slave, phase)?.verdict()
        }));
    }
    let rule = "CP2 to CP4: minimum, maximum, beyond both, wrong lengths: every data block answers as the table says";
    cases.push(Case::new(SECTION, rule, "sercos2.md 3.5, 4", |slave| walk::walk(slave)?.verdict()));
    cases
}

fn is_list(idn: u16) -> bool {
    drive::DICTIONARY.find(sercos::Idn(idn)).is_some_and(|block| block.fixed_bytes().is_none())
}

fn phases_of(may: [bool; 3]) -> String {
    let phases = (2..=4).zip(may).filter(|(_, may)| *may).map(|(phase, _)| format!("CP{phase}"));
    phases.collect::<Vec<_>>().join(" and ") + " only"
}
