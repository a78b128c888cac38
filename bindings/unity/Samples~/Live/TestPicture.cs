// Submits a moving picture, so that the scene shows holograms without a camera: a bright ball in front of a wall. Replace
// it by your camera's frames.
using Phasefront;
using UnityEngine;

public sealed class TestPicture : MonoBehaviour
{
    private const int Width = 480;
    private const int Height = 270;

    [SerializeField] private HologramView view;

    private readonly byte[] rgb = new byte[3 * Width * Height];
    private readonly byte[] depth = new byte[Width * Height];

    private void Update()
    {
        var time = Time.timeAsDouble;
        var (centreX, centreY, radius) = (Width * (0.5 + 0.25 * System.Math.Sin(time)), Height * 0.5, Height * 0.25);
        for (var y = 0; y < Height; y++)
            for (var x = 0; x < Width; x++)
            {
                var (dx, dy) = ((x - centreX) / radius, (y - centreY) / radius);
                var front = 1 - dx * dx - dy * dy;
                var at = y * Width + x;
                rgb[3 * at] = rgb[3 * at + 1] = rgb[3 * at + 2] = (byte)(front > 0 ? 120 + 130 * front : 50 + 40 * (x / 30 + y / 30 & 1));
                depth[at] = (byte)(front > 0 ? 128 - 100 * System.Math.Sqrt(front) : 230);
            }
        view.Submit(new CameraFrame
        {
            TimestampNs = (ulong)(time * 1e9) + 1,
            Colour = new ColourImage { Format = ColourFormat.Rgb, Width = Width, Height = Height, Planes = new[] { new ImagePlane(rgb, 3 * Width, 3) } },
            Depth = new DepthImage { Format = DepthFormat.NormalizedU8, Width = Width, Height = Height, Plane = new ImagePlane(depth, Width, 1) },
        });
    }
}
