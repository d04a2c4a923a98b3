//! Enables the tests that can run on this platform.

fn main() {
    farnear_test_data::declare();
    farnear_test_data::declare_emulated_rig();
}
