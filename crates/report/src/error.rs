use std::path::PathBuf;

use drape_cloth::file::WriteError;

/// Why a picture, film or chart was not written. The file at the path is then unchanged.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder is missing or read-only, or the disk is full.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The picture has no PNG form, for example because it has no pixels.
    #[error("cannot encode {} as PNG", path.display())]
    Png {
        /// The file that was to be written.
        path: PathBuf,
        /// What the encoder said.
        source: png::EncodingError,
    },
    /// The film has no GIF form.
    #[error("cannot encode {} as GIF", path.display())]
    Gif {
        /// The file that was to be written.
        path: PathBuf,
        /// What the encoder said.
        source: gif::EncodingError,
    },
    /// A film needs at least one frame.
    #[error("film {} has no frames", path.display())]
    NoFrames {
        /// The file that was to be written.
        path: PathBuf,
    },
    /// A frame differs in size from the first one, or does not fit a GIF.
    #[error(
        "frame {frame} of {} measures {} x {} pixels, expected {} x {} and 1 to 65535 each way",
        path.display(), found[0], found[1], expected[0], expected[1]
    )]
    FrameSize {
        /// The file that was to be written.
        path: PathBuf,
        /// Number of the frame, from 0.
        frame: usize,
        /// Width and height of that frame [px].
        found: [usize; 2],
        /// Width and height of the first frame [px].
        expected: [usize; 2],
    },
    /// The extension of a chart's file says which format is wanted.
    #[error("cannot tell the format of chart {}: expected extension png or svg", path.display())]
    ChartFormat {
        /// The file that was to be written.
        path: PathBuf,
    },
}
