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
    Unet(UnetConfig),
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

/// A convolutional network with a logit a pixel (see `unet.rs`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UnetConfig {
    /// Channels of each convolution.
    pub channels: usize,
    /// How often the image is halved.
    pub levels: usize,
    /// Units of the value's dense layer.
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
        let [parameters, seen] = match &self.network {
            NetworkConfig::Paper(paper) => {
                paper.validate(rows, columns)?;
                paper.size(rows, columns)
            }
            NetworkConfig::Compact(compact) => {
                compact.validate()?;
                compact.size(rows, columns)
            }
            NetworkConfig::Unet(unet) => {
                unet.validate()?;
                unet.size(rows, columns)
            }
        };
        let unless = |size: f64, of, most: f64| {
            let (found, expected) = (format!("{size:.0} {of}"), format!("at most {most:.0}"));
            ValueError::unless(size <= most, "network", found, expected)
        };
        unless(parameters, "parameters", MOST_PARAMETERS)?;
        unless(seen, "numbers that it sees of an image", MOST_SEEN)
    }
}

/// Most parameters: 0.5 GB, and as much for gradients and each moment of Adam.
const MOST_PARAMETERS: f64 = 134_217_728.0;
/// Most numbers that a network sees of an image: a rollout keeps thousands of images.
const MOST_SEEN: f64 = 524_288.0;

impl PaperConfig {
    /// Parameters, but for biases, and numbers that are seen of an image.
    fn size(&self, rows: usize, columns: usize) -> [f64; 2] {
        let pixels = (rows * columns) as f64;
        let (mut inputs, mut shared) = (3.0, 0.0);
        for &channels in &self.channels {
            let channels = channels as f64;
            shared += 9.0 * (inputs + channels) * channels;
            inputs = channels;
        }
        let blocks = self.channels.len();
        inputs *= ((rows >> blocks) * (columns >> blocks)) as f64;
        for &hidden in &self.hidden {
            shared += inputs * hidden as f64;
            inputs = hidden as f64;
        }
        [2.0 * shared + inputs * (pixels + 1.0), 3.0 * pixels]
    }

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
    /// Parameters, but for biases, and numbers that are seen of an image.
    fn size(&self, rows: usize, columns: usize) -> [f64; 2] {
        let [patch, border, channels, blocks, hidden] = [
            self.patch,
            self.border,
            self.channels,
            self.blocks,
            self.value_hidden,
        ]
        .map(|size| size as f64);
        let tokens = (rows.div_ceil(self.patch) * columns.div_ceil(self.patch)) as f64;
        let width = 3.0 * (patch + 2.0 * border).powi(2);
        let mixed = blocks * (tokens.powi(2) + channels.powi(2));
        let heads = channels * patch.powi(2) + 4.0 * tokens * hidden;
        [(width + tokens) * channels + mixed + heads, tokens * width]
    }

    fn validate(&self) -> Result<(), ValueError> {
        positive("network.compact.patch", &[self.patch])?;
        positive("network.compact.channels", &[self.channels])?;
        within("network.compact.border", &[self.border], 0)?;
        within("network.compact.blocks", &[self.blocks], 0)?;
        positive("network.compact.value_hidden", &[self.value_hidden])
    }
}

impl UnetConfig {
    /// Parameters, but for biases, and numbers that are seen of an image.
    fn size(&self, rows: usize, columns: usize) -> [f64; 2] {
        let [channels, levels, hidden] =
            [self.channels, self.levels, self.value_hidden].map(|size| size as f64);
        let convolutions = 2.0 * levels * channels + 2.0 * 8.0;
        let seen = 8.0 * (rows * columns) as f64;
        [9.0 * channels * convolutions + 8.0 * hidden, seen]
    }

    fn validate(&self) -> Result<(), ValueError> {
        // What gradients need of 500 images of 65 x 65 pixels is then at most 20 GB.
        let expected = "a number from 1 to 128";
        let (key, is_valid) = ("network.unet.channels", (1..=128).contains(&self.channels));
        ValueError::unless(is_valid, key, self.channels, expected)?;
        positive("network.unet.value_hidden", &[self.value_hidden])?;
        let expected = "a number from 1 to 8";
        let is_valid = (1..=8).contains(&self.levels);
        ValueError::unless(is_valid, "network.unet.levels", self.levels, expected)
    }
}

fn positive(key: &str, sizes: &[usize]) -> Result<(), ValueError> {
    within(key, sizes, 1)
}

/// Checks that there are `sizes` and that each is from `min` to 4096: greater ones only exhaust the
/// memory.
fn within(key: &str, sizes: &[usize], min: usize) -> Result<(), ValueError> {
    let is_valid = !sizes.is_empty() && sizes.iter().all(|size| (min..=4096).contains(size));
    let (found, expected) = (
        format!("{sizes:?}"),
        format!("whole numbers from {min} to 4096"),
    );
    ValueError::unless(is_valid, key, found, expected)
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

    /// The last sizes that fit, and what would abort or swap for minutes.
    #[test]
    fn networks_that_exhaust_the_memory_are_refused_with_their_size() {
        PolicyConfig::compact().validate(257, 257).unwrap();
        PolicyConfig::paper().validate(257, 257).unwrap();
        let refused = |change: fn(&mut CompactConfig), place| {
            let mut config = PolicyConfig::compact();
            let NetworkConfig::Compact(compact) = &mut config.network else {
                unreachable!("the preset is compact")
            };
            change(compact);
            let error = config.validate(33, 33).unwrap_err().to_string();
            assert!(error.contains(place), "{error}");
        };
        refused(|c| c.border = 500, "numbers that it sees");
        refused(|c| c.border = 4095, "parameters");
        refused(|c| (c.channels, c.blocks) = (4096, 4095), "parameters");
        refused(|c| c.patch = 4096, "parameters");
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
