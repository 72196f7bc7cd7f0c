//! Motion, closed over simulated motors and machines.
//!
//! One program, because each would be linked with everything for itself.

mod alignment;
mod alignment_on_machine;
mod bench;
mod brake;
mod brake_load;
mod caught_on_machine;
mod closed_loop;
mod current_bench;
mod current_on_machine;
mod current_tuning;
mod feed_forward;
mod field_weakening;
mod frequency_responses;
mod homing;
mod identification;
mod identification_bench;
mod interpolation;
mod loop_clock;
mod loop_clock_endurance;
mod loop_clock_wide;
mod low_side_shunts;
mod machine_bench;
mod open_phase;
mod position_on_machine;
mod regeneration_on_machine;
mod stops;
mod temperatures;
mod torque;
mod torque_on_machine;
mod trajectory;
mod velocity_on_machine;
mod velocity_tuning;
mod wrapping_data;
