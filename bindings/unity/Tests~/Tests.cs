// Tests the package without Unity. `Tests SUITE MODELS LEVELS VERSION` runs the conformance suite, whose levels and
// views must match Rust bit for bit, and checks the events of a listener.
using System;
using System.Collections;
using System.Collections.Generic;
using System.IO;
using System.Linq;
using System.Runtime.InteropServices;
using System.Threading;
using System.Web.Script.Serialization;
using Phasefront;

internal static class Tests
{
    private static readonly string[] Colours = { "rgba", "bgra", "rgb", "nv12", "yuv420" };
    private static readonly string[] Matrices = { "bt601", "bt709" };
    private static readonly string[] Encodings =
        { "srgb", "display-p3", "bt2020", "bt2020-hlg", "bt2020-pq", "amplitude" };
    private static readonly string[] Depths =
    {
        "metres-f32", "metres-f16", "disparity-f32", "disparity-f16", "millimetres-u16", "android-depth16",
        "normalized-u8", "normalized-u16", "relative-f32", "relative-f16",
    };
    private static readonly string[] Confidences = { "low-medium-high", "u8" };
    private static readonly string[] Modes = { "image", "video" };

    private static int Main(string[] arguments)
    {
        if (arguments.Length != 4)
        {
            Console.Error.WriteLine("usage: Tests SUITE MODELS LEVELS VERSION");
            return 2;
        }
        Require(Library.Version == arguments[3], "version " + Library.Version);
        var notices = Library.ThirdPartyNotices;
        Require(notices.StartsWith("# Third-party notices") && notices.Contains("rustfft"), "the notices are not whole");
        Func<string, byte[]> left = name => File.ReadAllBytes(Path.Combine(arguments[2], name));
        Conformance(arguments[0], arguments[1], left("levels.bin"), left("seen.bin"));
        Mistakes();
        Allocations();
        Live();
        for (var i = 0; i < 4; i++) ClosedByItsListener();
        Console.WriteLine("mistakes are told, live streams end");
        return 0;
    }

    private static void Require(bool holds, string what)
    {
        if (!holds) throw new Exception("not so: " + what);
    }

    private static IDictionary<string, object> Object(object json) => (IDictionary<string, object>)json;
    private static int Int(object json) => Convert.ToInt32(json);

    private static void Conformance(string suite, string models, byte[] expected, byte[] views)
    {
        var json = new JavaScriptSerializer { MaxJsonLength = int.MaxValue };
        var all = Object(json.DeserializeObject(File.ReadAllText(Path.Combine(suite, "cases.json"))));
        var memory = File.ReadAllBytes(Path.Combine(suite, "frames.bin"));
        var (got, seen) = (new List<byte>(), new List<byte>());
        var cases = (IEnumerable)all["cases"];
        var ran = 0;
        foreach (var one in cases)
        {
            Run(Object(one), suite, models, memory, got, seen);
            Require(got.SequenceEqual(expected.Take(got.Count)), Object(one)["name"] + ": the bits that Rust has");
            ran++;
        }
        Require(ran > 0 && got.Count == expected.Length, "all levels of the suite");
        Require(seen.SequenceEqual(views), "what Rust sees of them");
        Console.WriteLine("{0} cases, {1} levels: the bits that Rust has", ran, got.Count);
    }

    private static ImagePlane PlaneOf(object json, byte[] memory)
    {
        var plane = Object(json);
        var bytes = new byte[Int(plane["length"])];
        Array.Copy(memory, Int(plane["offset"]), bytes, 0, bytes.Length);
        return new ImagePlane(bytes, Int(plane["row_stride"]), Int(plane["pixel_stride"]));
    }

    private static CameraFrame FrameOf(object json, byte[] memory)
    {
        var frame = Object(json);
        var colour = Object(frame["colour"]);
        return new CameraFrame
        {
            TimestampNs = Convert.ToUInt64(frame["timestamp_ns"]),
            Colour = new ColourImage
            {
                Format = (ColourFormat)Array.IndexOf(Colours, colour["format"]),
                Width = Int(colour["width"]),
                Height = Int(colour["height"]),
                Matrix = (YuvMatrix)Array.IndexOf(Matrices, colour["matrix"]),
                VideoRange = (bool)colour["video_range"],
                Encoding = (RgbEncoding)Array.IndexOf(Encodings, colour["encoding"]),
                Planes = ((IEnumerable)colour["planes"]).Cast<object>().Select(plane => PlaneOf(plane, memory)).ToArray(),
            },
            Depth = frame["depth"] == null ? default : DepthOf(frame["depth"], memory),
            Confidence = frame["confidence"] == null ? (ConfidenceMap?)null : ConfidenceOf(frame["confidence"], memory),
            Rotation = (Rotation)(Int(frame["rotation"]) / 90),
            Mirrored = (bool)frame["mirrored"],
        };
    }

    private static DepthImage DepthOf(object json, byte[] memory)
    {
        var depth = Object(json);
        return new DepthImage
        {
            Format = (DepthFormat)Array.IndexOf(Depths, depth["format"]),
            Width = Int(depth["width"]),
            Height = Int(depth["height"]),
            Plane = PlaneOf(depth["plane"], memory),
        };
    }

    private static ConfidenceMap ConfidenceOf(object json, byte[] memory)
    {
        var map = Object(json);
        return new ConfidenceMap
        {
            Format = (ConfidenceFormat)Array.IndexOf(Confidences, map["format"]),
            Width = Int(map["width"]),
            Height = Int(map["height"]),
            Plane = PlaneOf(map["plane"], memory),
        };
    }

    private static HologramTarget TargetOf(IDictionary<string, object> one, string suite)
    {
        if (one["calibration"] != null)
            return HologramTarget.FromBytes(File.ReadAllBytes(Path.Combine(suite, (string)one["calibration"])));
        if (one["lut"] == null) return HologramTarget.FromToml((string)one["display"]);
        var levels = ((IEnumerable)one["lut"]).Cast<object>().Select(level => (byte)Int(level)).ToArray();
        return HologramTarget.WithLookUpTable((string)one["display"], levels);
    }

    private static HologramNetwork Model(string models, string file) => HologramNetwork.FromBytes(File.ReadAllBytes(Path.Combine(models, file)));

    private static SessionOptions OptionsOf(IDictionary<string, object> one, HologramTarget target, string suite, string models)
    {
        var name = (string)one["method"];
        var method = name == "sweep" ? HologramMethod.Sweep : name == "auto" ? HologramMethod.Auto : HologramMethod.Trained;
        var builtIn = name == "network" || name == "auto";
        var needsNone = name == "sweep" || name == "default";
        using (var network = needsNone ? null : builtIn ? HologramNetwork.BuiltIn() : Model(models, name))
        {
            var options = name == "default" ? SessionOptions.For(target) : SessionOptions.For(target, method, network);
            switch ((string)one["encoding"])
            {
                case "double-phase":
                    options.DoublePhase();
                    break;
                case "anti-alias":
                    options.AntiAlias();
                    break;
                case "band-limit":
                    options.BandLimit();
                    break;
                default:
                    using (var prefilter = Model(models, (string)one["encoding"])) options.Deep(prefilter);
                    break;
            }
            if (one["brightness"] != null) options.FixedBrightness(Convert.ToSingle(one["brightness"]));
            if (one["range"] != null)
            {
                var range = ((IEnumerable)one["range"]).Cast<object>().Select(Convert.ToSingle).ToArray();
                options.DepthRange(range[0], range[1]);
            }
            if (one["focus_steps"] != null) options.NaturalFocus((int)one["focus_steps"]);
            if (one["depth_network"] != null)
            {
                var onnx = File.ReadAllBytes(Path.Combine(suite, (string)one["depth_network"]));
                using (var depth = DepthNetwork.FromBytes(onnx, ColourScale.Unit)) options.DepthNetwork = depth;
            }
            return options;
        }
    }

    private static byte[] BytesOf(Planes planes)
    {
        Require(planes.Values.Length == planes.Numbers * planes.Width * planes.Height * planes.Colours, "all numbers");
        var bytes = new byte[sizeof(float) * planes.Values.Length];
        Buffer.BlockCopy(planes.Values, 0, bytes, 0, bytes.Length);
        return bytes;
    }

    private static void Run(
        IDictionary<string, object> one, string suite, string models, byte[] memory, List<byte> got, List<byte> seen)
    {
        using (var target = TargetOf(one, suite))
        using (var options = OptionsOf(one, target, suite, models))
        using (var session = HologramSession.Open(options, (RunningMode)Array.IndexOf(Modes, one["mode"])))
        {
            foreach (var frame in (IEnumerable)one["frames"])
                using (var hologram = session.Process(FrameOf(frame, memory)))
                {
                    for (var colour = 0; colour < hologram.Info.Colours; colour++) got.AddRange(hologram.Levels(colour));
                    seen.AddRange(BytesOf(hologram.Refocus(1.5)));
                    seen.AddRange(BytesOf(hologram.Field(-1)));
                }
        }
    }

    private static void Refused(Status status, string word, Action call)
    {
        try
        {
            call();
        }
        catch (PhasefrontException error)
        {
            Require(error.Status == status && error.Message.Contains(word), error.Status + ": " + error.Message);
            return;
        }
        throw new Exception("nothing was refused that is about " + word);
    }

    private static CameraFrame Sample(ulong timestampNs) => new CameraFrame
    {
        TimestampNs = timestampNs,
        Colour = new ColourImage
        {
            Format = ColourFormat.Rgb,
            Width = 48,
            Height = 36,
            Planes = new[] { new ImagePlane(Enumerable.Range(0, 48 * 36 * 3).Select(i => (byte)i).ToArray(), 48 * 3, 3) },
        },
        Depth = new DepthImage
        {
            Format = DepthFormat.NormalizedU8,
            Width = 48,
            Height = 36,
            Plane = new ImagePlane(Enumerable.Range(0, 48 * 36).Select(i => (byte)(i % 251)).ToArray(), 48, 1),
        },
    };

    private static void Mistakes()
    {
        Refused(Status.Display, "width", () => HologramTarget.FromToml("width = 0"));
        Refused(Status.Network, "rgbd-9", () => HologramNetwork.BuiltIn("rgbd-9"));
        using (var target = HologramTarget.FromToml("width = 48\nheight = 36"))
        using (var options = SessionOptions.For(target, HologramMethod.Sweep))
        {
            Require(target.Size.Equals((48, 36)), "the display's size");
            Refused(Status.Session, "listener", () => HologramSession.Open(options, RunningMode.Live));
            using (var session = HologramSession.Open(options, RunningMode.Video))
            {
                var frame = Sample(2);
                using (var hologram = session.Process(frame))
                {
                    Require(hologram.Info.Width == 48 && float.IsNaN(hologram.Info.NearM) && hologram.Info.Encoding == RgbEncoding.Srgb, "what is known");
                    var bytes = new byte[48 * 36 * 4];
                    var size = hologram.OutputSize(ModulatorLayout.Rgba);
                    Require(size.Width == 48 && size.Height == 36 && size.PixelBytes == 4 && size.Images == 1, "its size");
                    hologram.WriteOutput(ModulatorLayout.Rgba, new ImageMemory(bytes, 48 * 4));
                    Require(bytes[0] == hologram.Levels(0)[0] && bytes[3] == 255, "its image");
                    hologram.WriteOutput(ModulatorLayout.Grey16, new ImageMemory(bytes, 48 * 2), number: 1);
                    Require(bytes[0] == 0 && bytes[1] == hologram.Levels(1)[0], "its words");
                    hologram.WritePreview(hologram.ZAt(0.5, 0.5), 24, 18, ModulatorLayout.Bgra, new ImageMemory(bytes, 24 * 4));
                    Require(bytes[3] == 255, "its preview");
                    var small = new ImageMemory(new byte[8], 8);
                    Refused(Status.Setting, "36 rows", () => hologram.WriteOutput(ModulatorLayout.Rgb, small));
                    using (var modulator = Modulator.Named("ti-plm-p47"))
                    {
                        Require(modulator.OutputSize.Width == 1920 && modulator.OutputSize.PixelBytes == 3, "a modulator's size");
                        using (var own = modulator.Target()) Require(own.Size.Width == 960 && own.Size.Height == 540, "a modulator's target");
                        Refused(Status.Setting, "lasers", () => modulator.WriteOutput(hologram, small));
                    }
                    Pixels(hologram);
                    Refused(Status.Setting, "a shorter distance", () => hologram.Refocus(1e5));
                }
                Refused(Status.Frame, "null", () => session.Process(default(CameraFrame)));
                Refused(Status.Frame, "null", () => session.Submit(null));
                Refused(Status.Timestamp, "2", () => session.Process(frame));
                frame.TimestampNs = 3;
                Aligned(session, frame);
                frame.TimestampNs = 6;
                frame.Depth.Width = 480;
                Refused(Status.Frame, "depth", () => session.Process(frame));
                session.Dispose();
                try
                {
                    session.WarmUp();
                    throw new Exception("a session that has ended went on");
                }
                catch (ObjectDisposedException) { }
            }
        }
    }

    /// In a screen's pixels, red, green and blue are the level.
    private static void Pixels(Hologram hologram)
    {
        using (var modulator = Modulator.FromToml("width = 48\nheight = 36\npacking = \"grey\""))
        {
            var (grey, pixels) = (new byte[48 * 36], new byte[4 * 48 * 36]);
            modulator.WriteOutput(hologram, new ImageMemory(grey, 48), number: 1);
            modulator.WritePixels(hologram, ModulatorLayout.Bgra, new ImageMemory(pixels, 4 * 48), number: 1);
            Require(pixels.SequenceEqual(grey.SelectMany(level => new byte[] { level, level, level, 255 })), "a screen's pixels");
            var to = new ImageMemory(pixels, 4 * 48);
            Refused(Status.Setting, "Rgba or Bgra", () => modulator.WritePixels(hologram, ModulatorLayout.Rgb, to));
        }
    }

    /// Cameras of the same place and view leave depth as it is, and others move it.
    private static void Aligned(HologramSession session, CameraFrame frame)
    {
        var camera = new Intrinsics { Fx = 40, Fy = 40, Cx = 23.5, Cy = 17.5 };
        Func<Cameras?, byte[]> levels = cameras =>
        {
            session.Reset();
            frame.Cameras = cameras;
            using (var hologram = session.Process(frame)) return hologram.Levels(0);
        };
        frame.Depth.Format = DepthFormat.MillimetresU16;
        frame.Depth.Plane = new ImagePlane(
            Enumerable.Range(0, 48 * 36).SelectMany(i => BitConverter.GetBytes((ushort)(400 + i % 48 * 20))).ToArray(), 96, 2);
        var plain = levels(null);
        var same = levels(new Cameras { Colour = camera, Depth = camera });
        var apart = levels(new Cameras { Colour = camera, Depth = camera, TranslationM = new[] { 0.2, 0, 0 } });
        Require(!plain.SequenceEqual(apart) && !same.SequenceEqual(apart), "cameras that stand apart");
        Refused(Status.Frame, "9 numbers", () => levels(new Cameras { Colour = camera, Depth = camera, Rotation = new double[3] }));
        camera.Fx = 0;
        Refused(Status.Frame, "focal", () => levels(new Cameras { Colour = camera, Depth = camera }));
        session.Reset();
        frame.Cameras = null;
        var normalized = Sample(0).Depth;
        frame.Depth = normalized;
    }

    // What tests/counting.c counts: the memory of the process, without the virtual machine's own.
    [DllImport("__Internal")] private static extern ulong allocated_bytes();

    /// Prints the bytes that `call` allocates on the managed heap and elsewhere, and checks that they are fewer than those
    /// of the smallest image, the levels of one colour. The first calls may grow memory that later ones use again.
    private static void Count(string what, Action call)
    {
        var (managed, native) = (long.MaxValue, ulong.MaxValue);
        for (var i = 0; i < 8; i++)
        {
            var (before, outside) = (GC.GetAllocatedBytesForCurrentThread(), allocated_bytes());
            call();
            if (i < 3) continue;
            managed = Math.Min(managed, GC.GetAllocatedBytesForCurrentThread() - before);
            native = Math.Min(native, allocated_bytes() - outside);
        }
        Console.WriteLine("{0}: {1} bytes managed, {2} elsewhere", what, managed, native);
        Require(managed < 640 * 480 && native < 640 * 480, what + " allocates no image");
    }

    private static void Allocations()
    {
        const int Width = 640, Height = 480;
        var (before, outside) = (GC.GetAllocatedBytesForCurrentThread(), allocated_bytes());
        var pixels = new byte[4 * Width * Height];
        Marshal.FreeHGlobal(Marshal.AllocHGlobal(pixels.Length));
        Require(GC.GetAllocatedBytesForCurrentThread() - before >= pixels.Length, "managed allocations are counted");
        Require(allocated_bytes() - outside >= (ulong)pixels.Length, "other allocations are counted");
        var colour = Enumerable.Range(0, 4 * Width * Height).Select(i => (byte)(i * 37 % 251)).ToArray();
        var depth = Enumerable.Range(0, Width * Height).Select(i => (byte)(i / 700)).ToArray();
        var frame = new CameraFrame
        {
            Colour = new ColourImage { Format = ColourFormat.Rgba, Width = Width, Height = Height, Planes = new[] { new ImagePlane(colour, 4 * Width, 4) } },
            Depth = new DepthImage { Format = DepthFormat.NormalizedU8, Width = Width, Height = Height, Plane = new ImagePlane(depth, Width, 1) },
        };
        using (var modulator = Modulator.FromToml("width = 640\nheight = 480"))
        using (var target = modulator.Target())
        using (var options = SessionOptions.For(target, HologramMethod.Sweep))
        using (var session = HologramSession.Open(options, RunningMode.Video))
        {
            Func<Hologram> process = () =>
            {
                frame.TimestampNs += 33000000;
                return session.Process(frame);
            };
            Count("Process", () => process().Dispose());
            using (var hologram = process())
            {
                var (rgba, rgb) = (new ImageMemory(pixels, 4 * Width), new ImageMemory(pixels, 3 * Width));
                Count("WriteOutput of grey", () => hologram.WriteOutput(ModulatorLayout.Grey, new ImageMemory(pixels, Width), number: 2));
                Count("WriteOutput", () => hologram.WriteOutput(ModulatorLayout.Rgba, rgba));
                Count("WritePreview", () => hologram.WritePreview(0, Width, Height, ModulatorLayout.Rgba, rgba));
                Count("WriteOutput of a modulator", () => modulator.WriteOutput(hologram, rgb));
                Count("WritePixels of a modulator", () => modulator.WritePixels(hologram, ModulatorLayout.Rgba, rgba));
            }
            var made = new Counted();
            using (var live = HologramSession.Open(options, RunningMode.Live, made))
                Count("Submit, until it is a hologram", () =>
                {
                    frame.TimestampNs += 33000000;
                    live.Submit(frame);
                    made.One.Wait();
                });
        }
    }

    private sealed class Counted : ISessionListener
    {
        public readonly SemaphoreSlim One = new SemaphoreSlim(0);

        public void OnProcessed(Hologram hologram)
        {
            hologram.Dispose();
            One.Release();
        }

        public void OnDropped(ulong timestampNs, DropReason reason) { }

        public void OnFailed(ulong timestampNs, string message) => Console.Error.WriteLine(message);

        public void OnQualityChanged(ulong timestampNs, QualityChange change) { }
    }

    private sealed class Heard : ISessionListener
    {
        public int Holograms, Dropped;

        public void OnProcessed(Hologram hologram)
        {
            using (hologram) Interlocked.Increment(ref Holograms);
            throw new Exception("a listener may throw");
        }

        public void OnDropped(ulong timestampNs, DropReason reason) => Interlocked.Increment(ref Dropped);

        public void OnFailed(ulong timestampNs, string message) => Console.Error.WriteLine(message);

        public void OnQualityChanged(ulong timestampNs, QualityChange change) { }
    }

    private static void Live()
    {
        var heard = new Heard();
        using (var target = HologramTarget.FromToml("width = 48\nheight = 36"))
        using (var options = SessionOptions.For(target))
        {
            options.TargetRateHz = 1000;
            options.ClearQualityLevels();
            options.PushQualityLevel(HologramMethod.Sweep, null, 48, 36);
            options.PushQualityLevel(HologramMethod.Sweep, null, 24, 18, localSteps: 0);
            var session = HologramSession.Open(options, RunningMode.Live, heard);
            session.WarmUp();
            for (var i = 1ul; i <= 20; i++) session.Submit(Sample(i * 1000000));
            while (session.Statistics.Pending > 0) Thread.Sleep(1);
            var statistics = session.Statistics;
            Require(statistics.Submitted == 20 && statistics.Processed + statistics.Dropped == 20, "statistics");
            session.Dispose();
            Require(heard.Holograms > 0 && heard.Holograms + heard.Dropped == 20, "each frame is reported exactly once");
            Require(session.ListenerFailures == heard.Holograms, "what a listener throws is counted");
        }
    }

    // Disposes of its session at the first hologram, when other frames wait to be reported as dropped.
    private sealed class Closing : ISessionListener
    {
        public readonly ManualResetEventSlim Begun = new ManualResetEventSlim(), Submitted = new ManualResetEventSlim();
        public readonly CountdownEvent Told = new CountdownEvent(20);
        public HologramSession Session;

        public void OnProcessed(Hologram hologram)
        {
            hologram.Dispose();
            Begun.Set();
            Submitted.Wait();
            Session.Dispose();
            // Collects objects that are freed too early.
            GC.Collect();
            Told.Signal();
        }

        public void OnDropped(ulong timestampNs, DropReason reason) => Told.Signal();

        public void OnFailed(ulong timestampNs, string message) => Console.Error.WriteLine(message);

        public void OnQualityChanged(ulong timestampNs, QualityChange change) { }
    }

    private static void ClosedByItsListener()
    {
        var listener = new Closing();
        using (var target = HologramTarget.FromToml("width = 48\nheight = 36"))
        using (var options = SessionOptions.For(target, HologramMethod.Sweep))
        {
            listener.Session = HologramSession.Open(options, RunningMode.Live, listener);
            listener.Session.Submit(Sample(1));
            Require(listener.Begun.Wait(60000), "the first frame is a hologram");
            for (var i = 2ul; i <= 20; i++) listener.Session.Submit(Sample(i));
            listener.Submitted.Set();
            Require(listener.Told.Wait(60000), "each frame is told of after the listener ended the session");
        }
    }
}
