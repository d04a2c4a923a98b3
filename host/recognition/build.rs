//! Sets a cfg if the real data that some tests need is next to the repository.

fn main() {
    farnear_test_data::declare();
}
