//! Images of the town of any size, as GDAL mosaics (VRT) of one rendered tile per view: pixels are
//! decoded window by window as from any file, and take hardly any disk space.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::ensure;
use formats::raster::{Band, BandData, write_image_with_rpc};

use super::town::{self, Frame, Look};

/// A rendered tile of a view.
pub(crate) struct Tile {
    path: PathBuf,
    /// Columns and lines, at most a period of the view.
    size: [usize; 2],
}

/// Renders the first columns and lines of a view: as many as its images show, at most a period.
pub(crate) fn tile(folder: &Path, name: &str, look: &Look, shown: [usize; 2]) -> anyhow::Result<Tile> {
    let size = shown.map(|side| side.min(look.period()));
    let rpc = town::rpc(look, &Frame::square(look.period()));
    // The RPC must give the position that the rendering formula gives.
    let ([x, y, z], [a, b]) = ([100.0, -200.0, 30.0], look.slant);
    let p = town::project(&rpc, [x, y, z])?;
    let expected = [(x + a * z) / look.gsd_m, (b * z - y) / look.gsd_m];
    ensure!((p.sample - expected[0]).hypot(p.line - expected[1]) < 1e-6, "the RPC does not fit the tile: {p:?}");
    let path = folder.join(name);
    let pixels = town::tile(look, size);
    let bands = [Band { description: "pan", data: BandData::U16(&pixels) }];
    write_image_with_rpc(&path, &bands, &rpc, None, true)?;
    Ok(Tile { path, size })
}

/// Writes an image as a mosaic of a view's tile, with its RPC beside it.
pub(crate) fn image(folder: &Path, name: &str, tile: &Tile, look: &Look, frame: &Frame) -> anyhow::Result<PathBuf> {
    let (period, [columns, rows]) = (look.period(), frame.size);
    let shown = [0, 1].map(|k| (frame.first[k] + frame.size[k]).min(period));
    ensure!(
        shown[0] <= tile.size[0] && shown[1] <= tile.size[1],
        "{name} shows {shown:?} of a tile of {:?}",
        tile.size
    );
    let path = folder.join(format!("{name}.vrt"));
    let mut xml = format!("<VRTDataset rasterXSize=\"{columns}\" rasterYSize=\"{rows}\">\n");
    xml += "<VRTRasterBand dataType=\"UInt16\" band=\"1\">\n";
    for (y, h, v) in pieces(frame.first[1], rows, period) {
        for (x, w, u) in pieces(frame.first[0], columns, period) {
            writeln!(
                xml,
                "<SimpleSource><SourceFilename>{}</SourceFilename><SourceBand>1</SourceBand>\
                 <SourceProperties RasterXSize=\"{}\" RasterYSize=\"{}\" DataType=\"UInt16\" \
                 BlockXSize=\"256\" BlockYSize=\"256\"/><SrcRect xOff=\"{u}\" yOff=\"{v}\" xSize=\"{w}\" ySize=\"{h}\"/>\
                 <DstRect xOff=\"{x}\" yOff=\"{y}\" xSize=\"{w}\" ySize=\"{h}\"/></SimpleSource>",
                tile.path.display(),
                tile.size[0],
                tile.size[1]
            )?;
        }
    }
    std::fs::write(&path, xml + "</VRTRasterBand>\n</VRTDataset>\n")?;
    let sidecar = folder.join(format!("{name}_RPC.TXT"));
    formats::rpc::write(&sidecar, &town::rpc(look, frame), formats::rpc::RpcFormat::Text, true)?;
    Ok(path)
}

/// Returns where the pieces of a side begin in the image, their lengths, and where they begin in
/// the tile.
fn pieces(first: usize, length: usize, period: usize) -> Vec<(usize, usize, usize)> {
    let mut out = Vec::new();
    let mut at = 0;
    while at < length {
        let start = (first + at) % period;
        let piece = (period - start).min(length - at);
        out.push((at, piece, start));
        at += piece;
    }
    out
}
