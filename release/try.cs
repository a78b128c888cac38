// Runs the Unity package without Unity: `Try COLOUR.ppm DEPTH.pgm WIDTH HEIGHT LEVELS` writes the red levels of an
// RGB-D image.
using System;
using System.IO;
using System.Linq;
using Phasefront;

internal static class Try
{
    private static int Main(string[] arguments)
    {
        var width = int.Parse(arguments[2]);
        var height = int.Parse(arguments[3]);
        var rgb = Last(arguments[0], width * height * 3);
        var depth = Last(arguments[1], width * height);
        using (var target = HologramTarget.FromToml("width = " + width + "\nheight = " + height))
        using (var options = SessionOptions.For(target))
        using (var session = HologramSession.Open(options, RunningMode.Image))
        using (var hologram = session.Process(new CameraFrame
        {
            Colour = new ColourImage { Format = ColourFormat.Rgb, Width = width, Height = height, Planes = new[] { new ImagePlane(rgb, width * 3, 3) } },
            Depth = new DepthImage { Format = DepthFormat.NormalizedU8, Width = width, Height = height, Plane = new ImagePlane(depth, width, 1) },
        }))
            File.WriteAllBytes(arguments[4], hologram.Levels(0));
        return 0;
    }

    /// Reads the pixels of a Netpbm file, which are at its end.
    private static byte[] Last(string path, int count)
    {
        var all = File.ReadAllBytes(path);
        return all.Skip(all.Length - count).ToArray();
    }
}
