//! The camera's features (GenICam SFNC) in one table: registers, defaults, ranges and description nodes.

/// Type of a feature. Each has a 32-bit register.
#[derive(Clone, PartialEq, Debug)]
pub enum Value {
    Constant,
    Integer {
        min: u32,
        max: u32,
    },
    Number {
        min: u32,
        max: u32,
        parts: u32,
        /// As GenICam names it; empty for a factor.
        unit: &'static str,
    },
    Choice(Vec<(&'static str, u32)>),
    Command(u32),
}

#[derive(Clone, PartialEq, Debug)]
pub struct Feature {
    pub name: &'static str,
    pub category: &'static str,
    pub register: u32,
    pub value: Value,
    pub initial: u32,
}

pub const SENSOR_WIDTH: u32 = 0xA000;
pub const SENSOR_HEIGHT: u32 = 0xA004;
/// First column of the region.
pub const OFFSET_X: u32 = 0xA008;
/// First row of the region.
pub const OFFSET_Y: u32 = 0xA00C;
pub const WIDTH: u32 = 0xA010;
pub const HEIGHT: u32 = 0xA014;
/// [`MONO_8`] and so on.
pub const PIXEL_FORMAT: u32 = 0xA018;
/// Bytes per frame with chunks.
pub const PAYLOAD_SIZE: u32 = 0xA01C;
/// `Continuous` is the only mode.
pub const ACQUISITION_MODE: u32 = 0xA020;
/// Starts ([`START`]) and stops ([`STOP`]).
pub const ACQUISITION: u32 = 0xA024;
/// Frames per 1000 s when free running.
pub const FRAME_RATE: u32 = 0xA028;
/// `FrameStart` is the only trigger.
pub const TRIGGER_SELECTOR: u32 = 0xA02C;
pub const TRIGGER_MODE: u32 = 0xA030;
/// [`LINE_1`] or [`SOFTWARE`].
pub const TRIGGER_SOURCE: u32 = 0xA034;
/// `RisingEdge` is the only activation.
pub const TRIGGER_ACTIVATION: u32 = 0xA038;
pub const TRIGGER_SOFTWARE: u32 = 0xA03C;
/// Exposure in us for software triggers and free running; a hardware trigger's pulse sets its own.
pub const EXPOSURE_US: u32 = 0xA040;
/// Factor, in hundredths.
pub const GAIN: u32 = 0xA044;
pub const BLACK_LEVEL: u32 = 0xA048;
pub const CHUNK_MODE: u32 = 0xA04C;
/// Chunk selected for [`CHUNK_ENABLE`].
pub const CHUNK_SELECTOR: u32 = 0xA050;
/// Enables the timestamp chunk; the next register enables the frame id.
pub const CHUNK_ENABLE: u32 = 0xA054;
/// `TriggerWidth` is the only mode: the pulse of a hardware trigger is the exposure.
pub const EXPOSURE_MODE: u32 = 0xA05C;
pub const START: u32 = 1;
pub const STOP: u32 = 2;
/// The board's trigger line.
pub const LINE_1: u32 = 1;
pub const SOFTWARE: u32 = 7;
/// PFNC: 8 bits in a byte.
pub const MONO_8: u32 = 0x0108_0001;
/// PFNC: 12 bits in two bytes.
pub const MONO_12: u32 = 0x0110_0005;
pub const MONO_16: u32 = 0x0110_0007;

fn formats(bits: u8) -> Vec<(&'static str, u32)> {
    match bits {
        ..=8 => vec![("Mono8", MONO_8)],
        9..=12 => vec![("Mono12", MONO_12), ("Mono8", MONO_8)],
        _ => vec![("Mono16", MONO_16), ("Mono8", MONO_8)],
    }
}

pub fn table((width, height): (u16, u16), bits: u8) -> Vec<Feature> {
    let (width, height) = (u32::from(width), u32::from(height));
    let formats = formats(bits);
    let native = formats[0].1;
    let integer = |min, max| Value::Integer { min, max };
    let only = |name| Value::Choice(vec![(name, 0)]);
    let image = "ImageFormatControl";
    let acquisition = "AcquisitionControl";
    let feature =
        |name, category, register, value, initial| Feature { name, category, register, value, initial };
    vec![
        feature("SensorWidth", image, SENSOR_WIDTH, Value::Constant, width),
        feature("SensorHeight", image, SENSOR_HEIGHT, Value::Constant, height),
        feature("OffsetX", image, OFFSET_X, integer(0, width - 1), 0),
        feature("OffsetY", image, OFFSET_Y, integer(0, height - 1), 0),
        feature("Width", image, WIDTH, integer(1, width), width),
        feature("Height", image, HEIGHT, integer(1, height), height),
        feature("PixelFormat", image, PIXEL_FORMAT, Value::Choice(formats), native),
        feature("PayloadSize", "TransportLayerControl", PAYLOAD_SIZE, Value::Constant, 0),
        feature("AcquisitionMode", acquisition, ACQUISITION_MODE, only("Continuous"), 0),
        feature("AcquisitionStart", acquisition, ACQUISITION, Value::Command(START), STOP),
        feature("AcquisitionStop", acquisition, ACQUISITION, Value::Command(STOP), STOP),
        feature(
            "AcquisitionFrameRate",
            acquisition,
            FRAME_RATE,
            Value::Number { min: 1_000, max: 60_000, parts: 1_000, unit: "Hz" },
            25_000,
        ),
        feature("TriggerSelector", acquisition, TRIGGER_SELECTOR, only("FrameStart"), 0),
        feature("TriggerMode", acquisition, TRIGGER_MODE, Value::Choice(vec![("Off", 0), ("On", 1)]), 0),
        feature(
            "TriggerSource",
            acquisition,
            TRIGGER_SOURCE,
            Value::Choice(vec![("Line1", LINE_1), ("Software", SOFTWARE)]),
            LINE_1,
        ),
        feature("TriggerActivation", acquisition, TRIGGER_ACTIVATION, only("RisingEdge"), 0),
        feature("TriggerSoftware", acquisition, TRIGGER_SOFTWARE, Value::Command(1), 0),
        feature("ExposureMode", acquisition, EXPOSURE_MODE, only("TriggerWidth"), 0),
        feature(
            "ExposureTime",
            acquisition,
            EXPOSURE_US,
            Value::Number { min: 10, max: 10_000_000, parts: 1, unit: "us" },
            5_000,
        ),
        feature(
            "Gain",
            "AnalogControl",
            GAIN,
            Value::Number { min: 100, max: 1_600, parts: 100, unit: "" },
            100,
        ),
        feature(
            "BlackLevel",
            "AnalogControl",
            BLACK_LEVEL,
            Value::Number { min: 0, max: 255, parts: 1, unit: "" },
            0,
        ),
    ]
}
