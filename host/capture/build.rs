//! Which tests can run here.

fn main() {
    farnear_test_data::declare_emulated_rig();
    farnear_test_data::declare_program("ffmpeg", "ffmpeg");
    farnear_test_data::declare_program("fake_gige_camera", "arv-fake-gv-camera-0.8");
}
