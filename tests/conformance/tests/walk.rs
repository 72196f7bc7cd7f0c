//! No answer of the service channel disagrees with the table, and none takes long.

use bench::DriveSetup;
use conformance::Slave;
use conformance::walk::walk;
use drive::DICTIONARY;

#[test]
fn every_element_of_every_data_block_is_as_the_table_says_in_every_phase() {
    let mut slave = Slave::new(DriveSetup::catalogue(5));
    let report = walk(&mut slave).unwrap();
    println!("{} data blocks: {}", DICTIONARY.blocks().len(), report.summary());
    assert_eq!(report.elements, 3 * 7 * DICTIONARY.blocks().len() as u64);
    assert_eq!(report.verdict(), Ok(()), "{:#?}", report.disagreements);
}
