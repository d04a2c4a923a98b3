//! Which tests can run here.

fn main() {
    farnear_test_data::declare();
    farnear_test_data::declare_emulated_rig();
}
