use anyhow::Result;
use clap::Subcommand;
use farnear_workflows::rig::settings;

use super::Question;

#[derive(Subcommand)]
pub enum Job {
    /// List all settings with their defaults and ranges.
    #[command(after_help = "Example: farnear rig settings list --port /dev/ttyACM0 --json")]
    List(Question),
    /// Read one setting.
    #[command(after_help = "Example: farnear rig settings get coarse_backlash_nm --port /dev/ttyACM0")]
    Get {
        /// Name, as listed.
        key: String,
        #[command(flatten)]
        question: Question,
    },
    /// Change a setting, now and for later boots; values out of range are refused.
    #[command(after_help = "Example: farnear rig settings set coarse_backlash_nm 4000 --port /dev/ttyACM0")]
    Set {
        /// Name, as listed.
        key: String,
        /// New value, in the unit of its name.
        #[arg(allow_negative_numbers = true)]
        value: i32,
        #[command(flatten)]
        question: Question,
    },
}

pub fn run(job: Job) -> Result<()> {
    match job {
        Job::List(question) => question.answer(settings::list),
        Job::Get { key, question } => {
            let key = settings::key(&key)?;
            question.answer(|rig, context| settings::get(rig, key, context))
        }
        Job::Set { key, value, question } => {
            let key = settings::key(&key)?;
            question.answer(|rig, context| settings::set(rig, key, value, context))
        }
    }
}
