//! Says whether the real data that some tests need lie beside the repository.

fn main() {
    farnear_test_data::declare();
}
