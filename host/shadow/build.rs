//! Sets whether the real data of some tests is available.

fn main() {
    farnear_test_data::declare();
}
