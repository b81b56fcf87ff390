//! The profiles that come with the program.

use super::{DeviceProfile, ProfileError};

macro_rules! profiles {
    ($($name:literal),+ $(,)?) => {
        /// Name and text of each.
        const PROFILES: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../../../assets/devices/", $name, ".toml")))),+];
    };
}

profiles![
    "generic",
    "text",
    "ad7147",
    "ad7745",
    "ad7746",
    "ad7747",
    "fdc1004",
    "fdc1004-breakout",
    "fdc1004-labelled",
    "fdc1004-multichannel",
    "fdc2112",
    "fdc2114",
    "fdc2212",
    "fdc2214",
    "fdc2214-evm",
    "fdc2214-sketch",
    "grid-252",
    "grid-labelled",
    "marker-memory",
    "marker-u16",
    "mpr121",
    "mpr121-filtered",
    "mpr121-plotter",
    "plotter",
    "teensy",
    "teleplot",
    "trailer-i16",
];

/// Names of the built-in profiles.
pub fn built_in_names() -> Vec<&'static str> {
    PROFILES.iter().map(|(name, _)| *name).collect()
}

/// The built-in profile of a name.
///
/// # Errors
/// When there is none.
pub fn built_in(name: &str) -> Result<DeviceProfile, ProfileError> {
    match PROFILES.iter().find(|(known, _)| *known == name) {
        Some((_, text)) => DeviceProfile::parse(&format!("{name}.toml"), text),
        None => Err(ProfileError::Unknown { name: name.to_owned() }),
    }
}

#[cfg(test)]
mod tests {
    use super::{DeviceProfile, built_in, built_in_names};

    #[test]
    fn every_profile_is_read_and_survives_being_written() {
        for name in built_in_names() {
            let profile = built_in(name).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(profile.name, name);
            let text = profile.to_toml().unwrap();
            assert_eq!(DeviceProfile::parse("again.toml", &text).unwrap(), profile, "{text}");
        }
    }
}
