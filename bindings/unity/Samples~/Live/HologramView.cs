// Shows holograms of submitted frames on a screen that drives the modulator, by a RawImage that fills it. Call Submit for
// each frame. The scene Live has it and a TestPicture, which submits frames.
using System.Collections.Concurrent;
using Phasefront;
using UnityEngine;
using UnityEngine.UI;

public sealed class HologramView : MonoBehaviour, ISessionListener
{
    [SerializeField] private RawImage modulator;
    [SerializeField] private int width = 1920;
    [SerializeField] private int height = 1080;

    private readonly ConcurrentQueue<Hologram> made = new ConcurrentQueue<Hologram>();
    private HologramSession session;
    private Texture2D texture;
    private byte[] levels;

    private void OnEnable()
    {
        using (var target = HologramTarget.FromToml($"width = {width}\nheight = {height}"))
        using (var options = SessionOptions.For(target))
            session = HologramSession.Open(options, RunningMode.Live, this);
        // Neither filtered nor converted to linear light: a value between two levels is a different phase.
        texture = new Texture2D(width, height, TextureFormat.RGBA32, false, true) { filterMode = FilterMode.Point };
        modulator.texture = texture;
        levels = new byte[4 * width * height];
    }

    private void OnDisable()
    {
        session.Dispose();
        while (made.TryDequeue(out var hologram)) hologram.Dispose();
        Destroy(texture);
    }

    public DropReason Submit(CameraFrame frame) => session.Submit(frame);

    private void Update()
    {
        while (made.TryDequeue(out var hologram))
            using (hologram)
            {
                // The first row of a Unity texture is the lowest.
                hologram.WriteOutput(ModulatorLayout.Rgba, new ImageMemory(levels, 4 * width), flipY: true);
                texture.LoadRawTextureData(levels);
                texture.Apply();
            }
    }

    public void OnProcessed(Hologram hologram) => made.Enqueue(hologram);
    public void OnDropped(ulong timestampNs, DropReason reason) { }
    public void OnFailed(ulong timestampNs, string message) => Debug.LogWarning(message);
    public void OnQualityChanged(ulong timestampNs, QualityChange change) { }
}
