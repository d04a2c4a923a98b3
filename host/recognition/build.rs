//! Tells whether the real data that some tests need lie next to the repository.

fn main() {
    farnear_test_data::declare();
}
