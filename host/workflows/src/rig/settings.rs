use farnear_protocol::message::{Setting, SettingKey};
use serde::Serialize;

use super::{Rig, RigAddress};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
};

/// In the unit of its name.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct SettingFigures {
    pub key: &'static str,
    pub value: i32,
    pub default: i32,
    pub min: i32,
    pub max: i32,
}

impl From<Setting> for SettingFigures {
    fn from(setting: Setting) -> Self {
        let Setting { key, value, default, min, max } = setting;
        Self { key: key.name(), value, default, min, max }
    }
}

#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct AllSettings {
    /// In the order of their wire numbers.
    pub settings: Vec<SettingFigures>,
}

pub fn key(name: &str) -> Result<SettingKey> {
    SettingKey::ALL.into_iter().find(|key| key.name() == name).ok_or_else(|| {
        let names = SettingKey::ALL.map(SettingKey::name).join(", ");
        WorkflowError::parameter("setting", name, format!("unknown; expected one of {names}"))
    })
}

pub fn list(rig: &RigAddress, context: &Context<'_>) -> Result<AllSettings> {
    let rig = Rig::connect(rig, None, context)?;
    let settings = SettingKey::ALL.iter().map(|key| Ok(rig.client.setting(*key)?.into()));
    Ok(AllSettings { settings: settings.collect::<Result<_>>()? })
}

pub fn get(rig: &RigAddress, key: SettingKey, context: &Context<'_>) -> Result<SettingFigures> {
    Ok(Rig::connect(rig, None, context)?.client.setting(key)?.into())
}

/// Changes a setting immediately and for later boots.
pub fn set(rig: &RigAddress, key: SettingKey, value: i32, context: &Context<'_>) -> Result<SettingFigures> {
    Ok(Rig::connect(rig, None, context)?.client.set_setting(key, value)?.into())
}
