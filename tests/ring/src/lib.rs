//! A SERCOS II ring in software, from the bits on the fibre to the dialogue of a master station.
//!
//! * [`time`]: simulated time.
//! * [`wire`]: flags, zero insertion, NRZI and the frame check sequence; what a telegram can suffer on its way.
//! * [`fibre`], [`station`], [`ring`]: delays and faults, what stands between them, and the ring that joins them.
//! * [`ident`], [`service_client`]: data blocks, and the master's side of a drive's service channel.
//! * [`tester`]: a master of which a test decides every telegram.
//! * [`slots`], [`master`]: where the telegrams of a cycle stand, and a master that runs the ring up and moves it.
//! * [`software_slave`]: a drive without chip and product code, for tests of the master's side.
//! * [`capture`], [`player`]: recordings of masters, and a master that plays them and watches the drives.
//! * [`chip`]: the SERCON816 at register and RAM level.
#![forbid(unsafe_code)]

pub mod capture;
pub mod chip;
pub mod fibre;
pub mod ident;
pub mod master;
pub mod player;
pub mod ring;
pub mod service_client;
pub mod slots;
pub mod software_slave;
pub mod station;
pub mod tester;
pub mod time;
pub mod wire;

pub use fibre::RingConfiguration;
pub use master::ScriptedMaster;
pub use player::CapturePlayer;
pub use ring::Ring;
pub use software_slave::SoftwareSlave;
pub use station::{Master, SharedTap, Station, Tap};
pub use tester::Tester;
pub use time::Nanoseconds;
