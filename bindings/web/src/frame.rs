//! Camera frames: bytes and their layout.

use crate::error::{Answer, error, of_core};
use phasefront::Size;
use phasefront::input::{
    Alignment, CameraFrame, Cameras, ColourFormat, ColourImage, ConfidenceFormat, DepthFormat, DepthImage, Intrinsics,
    Orientation, Plane, RgbEncoding, Rotation, YuvEncoding, YuvMatrix,
};
use wasm_bindgen::prelude::*;

/// Bytes in the module's memory, with strides.
struct Bytes {
    bytes: Vec<u8>,
    row_stride: usize,
    pixel_stride: usize,
}

impl Bytes {
    fn new(bytes: Vec<u8>, row_stride: u32, pixel_stride: u32) -> Self {
        Bytes {
            bytes,
            row_stride: row_stride as usize,
            pixel_stride: pixel_stride as usize,
        }
    }

    fn plane(&self) -> Plane<'_> {
        Plane::new(&self.bytes, self.row_stride, self.pixel_stride)
    }
}

/// An image with one plane.
struct Image<F> {
    format: F,
    size: Size,
    memory: Bytes,
}

/// One frame, which is assembled part by part and then passed to a session.
#[wasm_bindgen]
pub struct RawFrame {
    timestamp_ns: u64,
    colour_format: ColourFormat,
    colour_size: Size,
    colour: Vec<Bytes>,
    depth: Option<Image<DepthFormat>>,
    confidence: Option<Image<ConfidenceFormat>>,
    orientation: Orientation,
    alignment: Alignment,
    encoding: RgbEncoding,
}

fn unknown(what: &str, name: &str, known: &str) -> JsValue {
    error(
        "frame",
        &format!("frame: there is no {what} '{name}'; there are {known}"),
    )
}

#[wasm_bindgen]
impl RawFrame {
    /// Creates a frame with a colour image of `format`, whose planes are added afterwards. `matrix` (by
    /// WebCodecs' names) and `video_range` define the encoding of luma and chroma.
    ///
    /// # Errors
    /// Throws an error of kind `frame` if the format or the matrix is unknown.
    #[wasm_bindgen(constructor)]
    pub fn new(
        timestamp_ns: u64,
        format: &str,
        width: u32,
        height: u32,
        matrix: &str,
        video_range: bool,
    ) -> Answer<RawFrame> {
        let matrix = match matrix {
            "smpte170m" | "bt470bg" => YuvMatrix::Bt601,
            "bt709" => YuvMatrix::Bt709,
            "bt2020-ncl" => YuvMatrix::Bt2020,
            other => return Err(unknown("matrix", other, "smpte170m, bt470bg, bt709, bt2020-ncl")),
        };
        let yuv = YuvEncoding { matrix, video_range };
        let colour_format = match format {
            "RGBA" | "RGBX" => ColourFormat::Rgba,
            "BGRA" | "BGRX" => ColourFormat::Bgra,
            "RGB" => ColourFormat::Rgb,
            "NV12" => ColourFormat::Nv12(yuv),
            "I420" => ColourFormat::Yuv420(yuv),
            other => {
                let known = "RGBA, RGBX, BGRA, BGRX, RGB, NV12, I420";
                return Err(unknown("colour format", other, known));
            }
        };
        Ok(RawFrame {
            timestamp_ns,
            colour_format,
            colour_size: Size {
                width: width as usize,
                height: height as usize,
            },
            colour: Vec::new(),
            depth: None,
            confidence: None,
            orientation: Orientation::default(),
            alignment: Alignment::default(),
            encoding: RgbEncoding::default(),
        })
    }

    /// Sets the meaning of red, green and blue.
    ///
    /// # Errors
    /// Throws an error of kind `frame` if the encoding is unknown.
    pub fn encoding(&mut self, name: &str) -> Answer<()> {
        let known = RgbEncoding::ALL.map(RgbEncoding::name).join(", ");
        self.encoding = RgbEncoding::from_name(name).ok_or_else(|| unknown("encoding", name, &known))?;
        Ok(())
    }

    /// Adds the next plane of the colour image. Strides are the bytes from one row to the next and from one pixel to
    /// the next.
    #[wasm_bindgen(js_name = colourPlane)]
    pub fn colour_plane(&mut self, bytes: Vec<u8>, row_stride: u32, pixel_stride: u32) {
        self.colour.push(Bytes::new(bytes, row_stride, pixel_stride));
    }

    /// Sets the depth image, with strides as in [`Self::colour_plane`].
    ///
    /// # Errors
    /// Throws an error of kind `frame` if the format is unknown.
    pub fn depth(
        &mut self,
        format: &str,
        width: u32,
        height: u32,
        bytes: Vec<u8>,
        row_stride: u32,
        pixel_stride: u32,
    ) -> Answer<()> {
        let format = match format {
            "metres-f32" => DepthFormat::MetresF32,
            "metres-f16" => DepthFormat::MetresF16,
            "disparity-f32" => DepthFormat::DisparityF32,
            "disparity-f16" => DepthFormat::DisparityF16,
            "millimetres-u16" => DepthFormat::MillimetresU16,
            "android-depth16" => DepthFormat::AndroidDepth16,
            "normalized-u8" => DepthFormat::NormalizedU8,
            "normalized-u16" => DepthFormat::NormalizedU16,
            "relative-f32" => DepthFormat::RelativeF32,
            "relative-f16" => DepthFormat::RelativeF16,
            other => {
                let known = "metres-f32, metres-f16, disparity-f32, disparity-f16, millimetres-u16, android-depth16, \
                             normalized-u8, normalized-u16, relative-f32, relative-f16";
                return Err(unknown("depth format", other, known));
            }
        };
        self.depth = Some(Image {
            format,
            size: Size {
                width: width as usize,
                height: height as usize,
            },
            memory: Bytes::new(bytes, row_stride, pixel_stride),
        });
        Ok(())
    }

    /// Sets the confidence of the depth, an image of the same size, with strides as in [`Self::colour_plane`].
    ///
    /// # Errors
    /// Throws an error of kind `frame` if the format is unknown.
    pub fn confidence(
        &mut self,
        format: &str,
        width: u32,
        height: u32,
        bytes: Vec<u8>,
        row_stride: u32,
        pixel_stride: u32,
    ) -> Answer<()> {
        let format = match format {
            "low-medium-high" => ConfidenceFormat::LowMediumHigh,
            "u8" => ConfidenceFormat::U8,
            other => return Err(unknown("confidence format", other, "low-medium-high, u8")),
        };
        self.confidence = Some(Image {
            format,
            size: Size {
                width: width as usize,
                height: height as usize,
            },
            memory: Bytes::new(bytes, row_stride, pixel_stride),
        });
        Ok(())
    }

    /// Sets the orientation of the displayed picture relative to the sensor's: rotated clockwise by `degrees`, then
    /// mirrored.
    ///
    /// # Errors
    /// Throws an error of kind `frame` if `degrees` is not 0, 90, 180 or 270.
    pub fn orientation(&mut self, degrees: u32, mirrored: bool) -> Answer<()> {
        let rotation = match degrees {
            0 => Rotation::Upright,
            90 => Rotation::Clockwise90,
            180 => Rotation::Half,
            270 => Rotation::Clockwise270,
            other => return Err(unknown("rotation", &other.to_string(), "0, 90, 180, 270")),
        };
        self.orientation = Orientation { rotation, mirrored };
        Ok(())
    }

    /// Sets the relation of the depth and the colour camera: fx, fy, cx, cy of the colour camera, then those of the
    /// depth camera, then, for separate cameras, the nine numbers of the rotation and the three of the translation.
    ///
    /// # Errors
    /// Throws an error of kind `frame` if the count of numbers is wrong.
    pub fn cameras(&mut self, numbers: &[f64]) -> Answer<()> {
        let of = |n: &[f64; 4]| Intrinsics {
            fx: n[0],
            fy: n[1],
            cx: n[2],
            cy: n[3],
        };
        let (parts, rest) = numbers.as_chunks::<4>();
        self.alignment = Alignment::Cameras(match (parts, rest) {
            ([colour, depth], []) => Cameras::concentric(of(colour), of(depth)),
            ([colour, depth, ..], []) if numbers.len() == 20 => Cameras {
                colour: of(colour),
                depth: of(depth),
                rotation: std::array::from_fn(|row| std::array::from_fn(|column| numbers[8 + 3 * row + column])),
                translation_m: [numbers[17], numbers[18], numbers[19]],
            },
            _ => {
                let count = numbers.len();
                let message = format!("frame: the cameras have {count} numbers; 8 are right, or 20 with a pose");
                return Err(error("frame", &message));
            }
        });
        Ok(())
    }
}

impl RawFrame {
    /// Returns the frame for the core.
    ///
    /// # Errors
    /// Throws an error of kind `frame` if [`ColourImage::new`] or [`DepthImage::new`] fails or the frame has no depth.
    pub(crate) fn frame(&self) -> Answer<CameraFrame<'_>> {
        let planes: Vec<Plane<'_>> = self.colour.iter().map(Bytes::plane).collect();
        let colour = ColourImage::new(self.colour_format, self.colour_size, &planes).map_err(of_core)?;
        let colour = colour.with_encoding(self.encoding);
        let depth = self
            .depth
            .as_ref()
            .ok_or_else(|| error("frame", "frame: it has no depth"))?;
        let mut image = DepthImage::new(depth.format, depth.size, depth.memory.plane()).map_err(of_core)?;
        if let Some(confidence) = &self.confidence {
            let plane = confidence.memory.plane();
            image = image
                .with_confidence(confidence.format, confidence.size, plane)
                .map_err(of_core)?;
        }
        let mut frame = CameraFrame::new(self.timestamp_ns, colour, image);
        frame.orientation = self.orientation;
        frame.alignment = self.alignment;
        Ok(frame)
    }
}
