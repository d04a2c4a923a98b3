fn main() {
    farnear_test_data::declare_programs();
}
