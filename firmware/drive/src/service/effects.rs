//! No parameter that nothing reads: every data block that can be written is seen by somebody.
//!
//! "Seen" is what the drive works with: settings of the loops, the checked cycle, what a command starts with, a text, a live value. What the
//! loops then do with it is for the tests that move a motor.

use std::collections::BTreeSet;
use std::string::{String, ToString};
use std::vec::Vec;

use rtic_core::Mutex;
use sercos::Idn;
use sercos::error::ServiceError;
use sercos::parameters::Parameters;
use sercos::service::Live;
use sercos::transition::{self, CyclicConfiguration, Invalid};
use servo::homing::HomingSettings;
use servo::path::MotionLimits;
use servo::probe::ProbeSettings;

use super::commissioning::{self, Finding as CommissioningFinding};
use super::procedures::PROBE_CONTROL;
use super::rig::{FACTS, Rig, Still, words_of};
use super::tests::{P, S, attempts};
use super::{checks, loops, scope};
use crate::dictionary::DICTIONARY;
use crate::dictionary::procedures::Procedure;
use crate::motion::identification::Plan;
use crate::oscilloscope::{self, Configuration};
use crate::remembering::set;
use crate::settings::invalid::InvalidSetting;
use crate::settings::{DriveSettings, POSITION_FEEDBACK_2_SOURCE, homing};
use crate::signal::command::COMMAND_VALUES;

/// Data of the user's own, which the drive keeps and gives back.
const KEPT_FOR_THE_USER: [(Idn, &str); 4] = [
    (S(141), "the motor's name, for the reader"),
    (S(142), "the axis' name, for the reader"),
    (P(7), "numbers of the control's own choice"),
    (P(8), "a text of the control's own choice"),
];

/// Everything that a parameter can have an effect on.
#[derive(Clone, Debug, PartialEq)]
struct Effects {
    cycle: Result<CyclicConfiguration, Vec<Invalid>>,
    loops: Result<DriveSettings, InvalidSetting>,
    homing: Result<(HomingSettings, MotionLimits), InvalidSetting>,
    probing: Option<ProbeSettings>,
    identifications: [Result<Plan, CommissioningFinding>; 3],
    gains: Result<[u32; 5], CommissioningFinding>,
    recording: Result<Configuration, ServiceError>,
    oscilloscope: (u64, u64),
    message: String,
    commands: Vec<u32>,
    controlled: u32,
    commutation_angle: u64,
    locked: bool,
    kept: bool,
    amended: Option<Vec<u8>>,
}

impl Effects {
    fn of(rig: &mut Rig) -> Self {
        let message = rig.text(S(95));
        let commands = COMMAND_VALUES.iter().map(|&(_, value)| rig.motion.command_data(value)).collect();
        rig.step(|_, parameters, context| {
            let capabilities = checks::capabilities(context.identity.bit_rate, parameters);
            let cycle = transition::check_cp3(parameters, &capabilities);
            let loops = loops::settings::<Still>(parameters);
            let mut computed = parameters.clone();
            let gains = commissioning::compute_gains(&mut computed, FACTS.frequency, |_| Ok(()));
            Self {
                cycle: cycle.map(|(cycle, _)| cycle).map_err(|invalid| invalid.findings().to_vec()),
                homing: loops.and_then(|settings| homing(parameters, &settings.motion)),
                loops,
                probing: ProbeSettings::new(parameters.get_word(PROBE_CONTROL)).ok(),
                identifications: [Procedure::IdentifyWinding, Procedure::IdentifyFlux, Procedure::IdentifyInertia]
                    .map(|procedure| commissioning::plan(procedure, parameters, FACTS.frequency)),
                gains: gains.map(|()| [100, 101, 104, 106, 107].map(|number| computed.get(S(number)))),
                recording: scope::configuration(parameters),
                oscilloscope: (
                    context.read(DICTIONARY.find(oscilloscope::STATE).unwrap(), parameters),
                    context.read(DICTIONARY.find(oscilloscope::WINDOW).unwrap(), parameters),
                ),
                message,
                commands,
                controlled: context.motion.lock(|motion| motion.controlled_bits()).0,
                commutation_angle: context.read(DICTIONARY.find(P(118)).unwrap(), parameters),
                locked: context.is_locked(),
                kept: {
                    context.note_stored(parameters);
                    context.keeping.has_unsaved()
                },
                amended: {
                    let mut page = [0; memory::MOST_BYTES];
                    let length = set::write_set(&set::told(&Parameters::new(&DICTIONARY)), &mut page).unwrap();
                    let length = set::amend_set(parameters, parameters.list(Idn::SELECTED_BACKUP), &mut page, length);
                    length.map(|length| page[..length].to_vec())
                },
            }
        })
    }

    /// What is not the same.
    fn differences(&self, other: &Self) -> Vec<&'static str> {
        [
            ("cycle", self.cycle != other.cycle),
            ("loops", self.loops != other.loops),
            ("homing", self.homing != other.homing),
            ("probing", self.probing != other.probing),
            ("identification", self.identifications != other.identifications),
            ("gains", self.gains != other.gains),
            ("recording", self.recording != other.recording || self.oscilloscope != other.oscilloscope),
            ("text", self.message != other.message),
            ("commands", self.commands != other.commands),
            ("bits", self.controlled != other.controlled),
            ("commutation", self.commutation_angle != other.commutation_angle),
            ("lock", self.locked != other.locked),
            ("memory", self.kept != other.kept),
            ("selection", self.amended != other.amended),
        ]
        .into_iter()
        .filter_map(|(what, differs)| differs.then_some(what))
        .collect()
    }
}

/// Drives on which a parameter may have an effect that it has on no other: what switches it on is set.
fn drives() -> Vec<Vec<(Idn, Vec<u16>)>> {
    let words = |list: &[(Idn, &[u16])]| list.iter().map(|(idn, words)| (*idn, words.to_vec())).collect::<Vec<_>>();
    let slots: &[(Idn, &[u16])] = &[
        (S(2), &[2_000]),
        (S(6), &[200]),
        (S(89), &[1_000]),
        (S(8), &[1_500]),
        (S(7), &[1_800]),
        (S(9), &[1]),
        (S(10), &[8]),
    ];
    let more: [&[(Idn, &[u16])]; 13] = [
        &[],
        // Linear data by parameters, and data of the load.
        &[(S(76), &[0x09]), (S(44), &[0x09]), (S(160), &[0x09])],
        &[(S(76), &[0x4A]), (S(44), &[0x4A]), (S(160), &[0x4A])],
        // Torque data in newton metres, by parameters.
        &[(S(86), &[0x0A])],
        &[(S(76), &[0x82])],
        &[(S(55), &[0x10])],
        &[(P(170), &[2]), (P(172), &[2_000]), (P(174), &[2]), (P(176), &[2_000])],
        &[(S(15), &[7])],
        &[(S(15), &[12])],
        &[
            (S(26), &[4, 4, 11, 12]),
            (S(27), &[4, 4, 0x8013, 0x8013]),
            (S(301), &[0x8013]),
            (S(303), &[0x8013]),
            (S(305), &[11]),
            (S(307), &[11]),
        ],
        &[(P(120), &[3]), (P(205), &[0x0101])],
        &[(P(235), &[470])],
        // 1.5 Nm/A: magnets of 578 V at S-0-0113.
        &[(P(114), &[0xE360, 0x0016])],
    ];
    more.into_iter().map(|more| words(&[slots, more].concat())).collect()
}

fn drive(parameters: &[(Idn, Vec<u16>)]) -> Rig {
    let mut rig = Rig::new();
    for (idn, words) in parameters {
        rig.write(*idn, words).unwrap();
    }
    rig
}

#[test]
fn every_data_block_that_can_be_written_has_an_effect_or_refuses_to_be_changed() {
    let drives = drives();
    let (mut without, mut kinds) = (Vec::new(), BTreeSet::new());
    for block in
        DICTIONARY.blocks().iter().filter(|block| !block.attribute.is_read_only() && !block.attribute.command())
    {
        let mut seen = None;
        let mut taken = BTreeSet::new();
        'drives: for parameters in &drives {
            let before = Effects::of(&mut drive(parameters));
            for words in attempts(block) {
                let mut rig = drive(parameters);
                if rig.write(block.idn, &words).is_err() {
                    continue;
                }
                taken.insert(words);
                if let [kind, ..] = Effects::of(&mut rig).differences(&before)[..] {
                    seen = Some(kind);
                    break 'drives;
                }
            }
        }
        let kept = KEPT_FOR_THE_USER.iter().any(|&(idn, _)| idn == block.idn);
        // One value is all that it takes: there is nothing to have an effect.
        let constant = taken.len() == 1 && block.minimum.is_some() && block.minimum == block.maximum;
        assert!(!(kept && seen.is_some()), "{}: more than kept for the user", block.idn);
        match seen {
            Some(kind) => {
                kinds.insert(kind);
            }
            None if kept || constant => {}
            None => without.push(block.idn.to_string()),
        }
    }
    assert!(without.is_empty(), "nothing reads {without:?}");
    // No kind of effect is there in vain.
    assert_eq!(kinds.len(), 14, "{kinds:?}");
}

#[test]
fn every_choice_of_a_list_of_choices_is_another() {
    // Those whose values are names, not amounts or bits; P-0-0141 = 2 is one of its other two, see `settings`.
    for idn in [S(265), P(117), P(140), P(170), P(174), POSITION_FEEDBACK_2_SOURCE] {
        let block = DICTIONARY.find(idn).unwrap();
        let (Some(least), Some(most)) = (block.minimum, block.maximum) else { panic!("{idn} has no limits") };
        let mut seen: Vec<Effects> = Vec::new();
        for value in least..=most {
            let mut rig = drive(&[(P(172), std::vec![2_000]), (P(176), std::vec![2_000])]);
            rig.write(idn, &words_of(block, value as u64)).unwrap();
            let effects = Effects::of(&mut rig);
            assert!(!seen.contains(&effects), "{idn} = {value} is the same as a lower value");
            seen.push(effects);
        }
        assert!(seen.len() >= 2, "{idn}");
    }
}
