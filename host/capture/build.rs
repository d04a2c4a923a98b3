fn main() {
    farnear_test_data::declare_emulated_rig();
    farnear_test_data::declare_programs();
}
