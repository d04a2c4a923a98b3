//! GenICam description (GenApi 1.0, XML) that clients read from the camera.

use crate::features::{CHUNK_ENABLE, CHUNK_MODE, CHUNK_SELECTOR, Feature, Value};

pub const FILE: &str = "farnear-emulated.xml";
/// Also in the bootstrap registers.
pub const MODEL: &str = "emulated";
pub const VENDOR: &str = "farnear";
/// Chunk ids: timestamp and frame id.
pub const CHUNKS: [(&str, u32); 2] = [("Timestamp", 0xFA00_0001), ("FrameID", 0xFA00_0002)];
pub const TICKS_PER_SECOND: u32 = 1_000_000_000;

pub fn description(features: &[Feature]) -> String {
    let mut categories: Vec<&str> = features.iter().map(|feature| feature.category).collect();
    categories.dedup();
    categories.sort_unstable();
    categories.dedup();
    let list = |names: &mut dyn Iterator<Item = &str>| -> String {
        names.map(|name| format!("<pFeature>{name}</pFeature>")).collect()
    };
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<RegisterDescription ModelName=\"{MODEL}\" VendorName=\"{VENDOR}\" \
         StandardNameSpace=\"GEV\" SchemaMajorVersion=\"1\" SchemaMinorVersion=\"0\" SchemaSubMinorVersion=\"1\" MajorVersion=\"1\" \
         MinorVersion=\"0\" SubMinorVersion=\"0\" ToolTip=\"The emulated rig's camera\" ProductGuid=\"0\" VersionGuid=\"0\" \
         xmlns=\"http://www.genicam.org/GenApi/Version_1_0\">\n"
    );
    let all = categories.iter().copied().chain(["ChunkDataControl"]);
    text += &format!("<Category Name=\"Root\">{}</Category>\n", list(&mut { all }));
    for category in &categories {
        let mut names =
            features.iter().filter(|feature| feature.category == *category).map(|feature| feature.name);
        text += &format!("<Category Name=\"{category}\">{}</Category>\n", list(&mut names));
    }
    let mut registers = Vec::new();
    for feature in features {
        text += &node(feature);
        // Two commands may share a register.
        if !registers.contains(&feature.register) {
            registers.push(feature.register);
            text += &register(&register_name(feature.register), feature.register, &feature.value);
        }
    }
    text += &chunks();
    text += &format!(
        "<Integer Name=\"GevTimestampTickFrequency\"><Value>{TICKS_PER_SECOND}</Value></Integer>\n<Port Name=\"Device\"/>\n\
         </RegisterDescription>\n"
    );
    text
}

fn register_name(register: u32) -> String {
    format!("Register{register:04X}")
}

fn node(feature: &Feature) -> String {
    let (name, value) = (feature.name, format!("<pValue>{}</pValue>", register_name(feature.register)));
    match &feature.value {
        Value::Constant => format!("<Integer Name=\"{name}\">{value}</Integer>\n"),
        Value::Integer { min, max } => {
            format!(
                "<Integer Name=\"{name}\">{value}<Min>{min}</Min><Max>{max}</Max><Inc>1</Inc></Integer>\n"
            )
        }
        Value::Number { min, max, parts, unit } => {
            let of = |number: u32| f64::from(number) / f64::from(*parts);
            format!(
                "<Float Name=\"{name}\"><pValue>{name}Parts</pValue><Min>{}</Min><Max>{}</Max><Unit>{unit}</Unit></Float>\n\
                 <Converter Name=\"{name}Parts\"><FormulaTo>FROM * {parts}</FormulaTo><FormulaFrom>TO / {parts}.0</FormulaFrom>{value}\
                 <Slope>Increasing</Slope></Converter>\n",
                of(*min),
                of(*max)
            )
        }
        Value::Choice(choices) => {
            let entries: String = choices
                .iter()
                .map(|(entry, value)| {
                    format!("<EnumEntry Name=\"{entry}\"><Value>{value}</Value></EnumEntry>")
                })
                .collect();
            format!("<Enumeration Name=\"{name}\">{entries}{value}</Enumeration>\n")
        }
        Value::Command(written) => {
            format!("<Command Name=\"{name}\">{value}<CommandValue>{written}</CommandValue></Command>\n")
        }
    }
}

fn register(name: &str, address: u32, value: &Value) -> String {
    let access = if *value == Value::Constant { "RO" } else { "RW" };
    int_register(name, &format!("<Address>0x{address:X}</Address>"), 4, access, "Device")
}

fn int_register(name: &str, address: &str, length: u32, access: &str, port: &str) -> String {
    format!(
        "<IntReg Name=\"{name}\">{address}<Length>{length}</Length><AccessMode>{access}</AccessMode><pPort>{port}</pPort>\
         <Cachable>NoCache</Cachable><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>\n"
    )
}

fn chunks() -> String {
    let entries: String = (0..)
        .zip(CHUNKS)
        .map(|(index, (name, _))| format!("<EnumEntry Name=\"{name}\"><Value>{index}</Value></EnumEntry>"))
        .collect();
    let mut text = format!(
        "<Category Name=\"ChunkDataControl\"><pFeature>ChunkModeActive</pFeature><pFeature>ChunkSelector</pFeature>\
         <pFeature>ChunkEnable</pFeature><pFeature>ChunkTimestamp</pFeature><pFeature>ChunkFrameID</pFeature></Category>\n\
         <Boolean Name=\"ChunkModeActive\"><pValue>ChunkModeRegister</pValue></Boolean>\n\
         <Enumeration Name=\"ChunkSelector\">{entries}<pValue>ChunkSelectorRegister</pValue></Enumeration>\n\
         <Boolean Name=\"ChunkEnable\"><pValue>ChunkEnableRegister</pValue></Boolean>\n"
    );
    let at = |address: u32| format!("<Address>0x{address:X}</Address>");
    text += &int_register("ChunkModeRegister", &at(CHUNK_MODE), 4, "RW", "Device");
    text += &int_register("ChunkSelectorRegister", &at(CHUNK_SELECTOR), 4, "RW", "Device");
    let enable = at(CHUNK_ENABLE) + "<pIndex Offset=\"4\">ChunkSelectorRegister</pIndex>";
    text += &int_register("ChunkEnableRegister", &enable, 4, "RW", "Device");
    for (name, id) in CHUNKS {
        text += &int_register(&format!("Chunk{name}"), &at(0), 8, "RO", &format!("Chunk{name}Port"));
        text += &format!("<Port Name=\"Chunk{name}Port\"><ChunkID>{id:08X}</ChunkID></Port>\n");
    }
    text
}
