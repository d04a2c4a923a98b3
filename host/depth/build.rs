//! Tells the tests whether the real data are beside the repository.

fn main() {
    farnear_test_data::declare();
}
