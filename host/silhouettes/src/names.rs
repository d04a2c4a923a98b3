/// `Display` and `FromStr` of an enum by the names of its variants. `$what` is the noun of the error, such as "fill".
#[macro_export]
macro_rules! named {
    ($type:ident, $what:literal, $($name:literal => $variant:ident),+) => {
        impl std::fmt::Display for $type {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(match self {
                    $(Self::$variant => $name,)+
                })
            }
        }

        impl std::str::FromStr for $type {
            type Err = String;

            fn from_str(text: &str) -> Result<Self, String> {
                let [before @ .., last] = [$($name),+];
                match text {
                    $($name => Ok(Self::$variant),)+
                    other => Err(format!("unknown {} `{other}`: expected {} or {last}", $what, before.join(", "))),
                }
            }
        }
    };
}
