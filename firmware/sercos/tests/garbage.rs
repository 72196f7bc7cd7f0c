//! What the service channel does with steps that no master would send.

use crate::support::Slave;
use proptest::prelude::*;
use sercos::Idn;
use sercos::service::{ReadPosition, Reply, Step};

fn any_step() -> impl Strategy<Value = Step> {
    let info = prop_oneof![
        // IDNs that exist, short lengths, commands.
        prop::sample::select(vec![
            2u16, 16, 17, 24, 32, 36, 79, 99, 103, 127, 128, 141, 142, 267, 301, 328, 0x8007, 0x8008, 0x8013
        ]),
        0u16..8,
        any::<u16>(),
    ];
    (prop_oneof![0u8..8, Just(7), any::<u8>()], any::<bool>(), any::<bool>(), info, any::<bool>(), any_position())
        .prop_map(|(element, write, end, info, new_transfer, position)| Step {
            element,
            write,
            end,
            info,
            new_transfer,
            position,
        })
}

fn any_position() -> impl Strategy<Value = ReadPosition> {
    prop::sample::select(vec![
        ReadPosition::Within,
        ReadPosition::NotLast,
        ReadPosition::TookLast,
        ReadPosition::Exhausted,
    ])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn no_stream_of_steps_panics_or_changes_anything_with_an_error(
        steps in prop::collection::vec(any_step(), 1..200),
        phase in 2u8..=4,
    ) {
        let mut slave = if phase == 2 { Slave::in_cp2() } else { Slave::in_cp4() };
        for step in steps {
            let parameters = slave.parameters.clone();
            let values = slave.drive.values.clone();
            let status = [99, 127, 128].map(|number| slave.server.command_status(Idn::standard(number)));
            let reply = slave.server.step(step, &mut slave.parameters, &mut slave.drive);
            let may_change = step.element == 7 && step.write && step.end && matches!(reply, Reply::Accept { .. });
            if !may_change {
                prop_assert_eq!(&slave.parameters, &parameters);
                prop_assert_eq!(&slave.drive.values, &values);
                prop_assert_eq!([99, 127, 128].map(|number| slave.server.command_status(Idn::standard(number))), status);
            }
            match reply {
                Reply::Send(words) => prop_assert!(!words.is_empty() && !step.write),
                Reply::Continue => prop_assert!(!step.write),
                Reply::Accept { .. } => prop_assert!(step.write || !(1..=7).contains(&step.element)),
                Reply::Error(error) => prop_assert!(error.code() != 0),
            }
        }
        // Whatever came before: close, open, read.
        prop_assert_eq!(slave.close(), Ok(0));
        prop_assert_eq!(slave.open(Idn::standard(3)), Ok(0));
        prop_assert_eq!(slave.read(7, 1), Ok(vec![12]));
    }

    #[test]
    fn every_value_that_is_accepted_reads_back(value: u64, place: prop::sample::Index) {
        let mut slave = Slave::in_cp2();
        let blocks: Vec<_> = crate::sample::DICTIONARY.blocks()
            .iter()
            .filter(|block| block.fixed_bytes().is_some() && !block.attribute.command())
            .collect();
        let block = blocks[place.index(blocks.len())];
        let words = usize::from(block.fixed_bytes().unwrap() / 2);
        let data = [0, 16, 32, 48].map(|shift| (value >> shift & 0xFFFF) as u16);
        slave.open(block.idn).unwrap();
        let before = slave.read(7, words).unwrap();
        let result = slave.write(&data[..words]);
        let after = slave.read(7, words).unwrap();
        prop_assert_eq!(after, if result.is_ok() { data[..words].to_vec() } else { before });
        let number = block.attribute.value_of(value);
        let inside = block.minimum.is_none_or(|minimum| number >= minimum) && block.maximum.is_none_or(|maximum| number <= maximum);
        let writable = inside && !block.attribute.is_protected_in(sercos::Phase::Cp2);
        if block.restricted {
            prop_assert!(writable || result.is_err());
        } else {
            prop_assert_eq!(result.is_ok(), writable);
        }
    }
}
