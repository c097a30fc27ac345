use drape_cloth::file::ValueError;
use serde::{Deserialize, Serialize};

/// What the networks see and how they are built.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyConfig {
    /// Distance to the tool that the network sees as 1 [mm].
    pub distance_scale_mm: f32,
    pub network: NetworkConfig,
}

/// Which network, and its sizes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NetworkConfig {
    Paper(PaperConfig),
    Compact(CompactConfig),
}

/// The paper's network (Section 4.3): separate policy and value networks of VGG blocks
/// (twice [3x3 convolution, ReLU], then 2x2 max-pooling) and dense layers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PaperConfig {
    /// Channels of each block. The paper does not state them; 8, 16, 32 are those of the
    /// documentation of its framework, Maze.
    pub channels: Vec<usize>,
    /// Units of each dense layer.
    pub hidden: Vec<usize>,
}

/// A network for training on a CPU: patches, mixed among places and among channels, and
/// taken back to pixels by a linear map (see `compact.rs`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompactConfig {
    /// Width and height of a patch, the unit of the trunk [pixel].
    pub patch: usize,
    /// Pixels around its patch that the stem sees on each side.
    pub border: usize,
    /// Channels of the trunk.
    pub channels: usize,
    /// Mixing blocks.
    pub blocks: usize,
    /// Units of the value head's dense layer.
    pub value_hidden: usize,
}

impl PolicyConfig {
    /// The paper's network.
    pub fn paper() -> Self {
        Self {
            distance_scale_mm: 1000.0,
            network: NetworkConfig::Paper(PaperConfig {
                channels: vec![8, 16, 32],
                hidden: vec![256, 256],
            }),
        }
    }

    /// The network for training on a CPU.
    pub fn compact() -> Self {
        Self {
            distance_scale_mm: 20.0,
            network: NetworkConfig::Compact(CompactConfig {
                patch: 4,
                border: 1,
                channels: 24,
                blocks: 2,
                value_hidden: 64,
            }),
        }
    }

    /// Checks every value against its range, for an image of `rows` x `columns` pixels.
    pub fn validate(&self, rows: usize, columns: usize) -> Result<(), ValueError> {
        let scale = self.distance_scale_mm;
        let is_valid = scale.is_finite() && scale > 0.0;
        let expected = "a finite number above 0";
        ValueError::unless(is_valid, "distance_scale_mm", scale, expected)?;
        match &self.network {
            NetworkConfig::Paper(paper) => paper.validate(rows, columns),
            NetworkConfig::Compact(compact) => compact.validate(),
        }
    }
}

impl PaperConfig {
    fn validate(&self, rows: usize, columns: usize) -> Result<(), ValueError> {
        positive("network.paper.channels", &self.channels)?;
        positive("network.paper.hidden", &self.hidden)?;
        let blocks = self.channels.len();
        let (is_valid, found) = (rows.min(columns) >> blocks > 0, format!("{blocks} blocks"));
        let expected = "few enough to leave a pixel after halving the image in each block";
        ValueError::unless(is_valid, "network.paper.channels", found, expected)
    }
}

impl CompactConfig {
    fn validate(&self) -> Result<(), ValueError> {
        positive("network.compact.patch", &[self.patch])?;
        positive("network.compact.channels", &[self.channels])?;
        // None is allowed of these two.
        positive("network.compact.border", &[self.border.saturating_add(1)])?;
        positive("network.compact.blocks", &[self.blocks.saturating_add(1)])?;
        positive("network.compact.value_hidden", &[self.value_hidden])
    }
}

/// Checks that there are `sizes` and that each is from 1 to 4096: greater ones only exhaust the
/// memory.
fn positive(key: &str, sizes: &[usize]) -> Result<(), ValueError> {
    let is_valid = !sizes.is_empty() && sizes.iter().all(|size| (1..=4096).contains(size));
    let found = format!("{sizes:?}");
    ValueError::unless(is_valid, key, found, "whole numbers from 1 to 4096")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_valid_and_survive_toml() {
        for config in [PolicyConfig::paper(), PolicyConfig::compact()] {
            config.validate(33, 33).unwrap();
            let text = toml::to_string(&config).unwrap();
            assert_eq!(toml::from_str::<PolicyConfig>(&text).unwrap(), config);
        }
    }

    #[test]
    fn unknown_key_and_value_out_of_range_are_named() {
        let mut text = toml::to_string(&PolicyConfig::compact()).unwrap();
        text.push_str("chanels = 3\n");
        let error = toml::from_str::<PolicyConfig>(&text).unwrap_err();
        assert!(error.to_string().contains("chanels"), "{error}");

        let mut config = PolicyConfig::paper();
        config.distance_scale_mm = f32::NAN;
        assert_eq!(
            config.validate(65, 65).unwrap_err().to_string(),
            "`distance_scale_mm` is NaN, expected a finite number above 0"
        );
        let small = PolicyConfig::paper().validate(7, 65).unwrap_err();
        assert_eq!(small.key, "network.paper.channels");
    }
}
