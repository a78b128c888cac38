// The part of Unity that the sample uses, declared by hand, so that bindings/c/test checks its types without Unity. Nothing here
// runs or ships.
using System;

namespace UnityEngine
{
    public class Object { public static void Destroy(Object what) { throw new NotSupportedException(); } }
    public class MonoBehaviour : Object { }
    [AttributeUsage(AttributeTargets.Field)]
    public sealed class SerializeField : Attribute { }
    public static class Debug { public static void LogWarning(object message) { throw new NotSupportedException(); } }
    public static class Time { public static double timeAsDouble { get { throw new NotSupportedException(); } } }
    public enum TextureFormat { RGBA32 }
    public enum FilterMode { Point }
    public class Texture : Object { public FilterMode filterMode { get; set; } }
    public class Texture2D : Texture
    {
        public Texture2D(int width, int height, TextureFormat format, bool mipChain, bool linear) { }
        public void LoadRawTextureData(byte[] data) { throw new NotSupportedException(); }
        public void Apply() { throw new NotSupportedException(); }
    }
}

namespace UnityEngine.UI
{
    public class RawImage : MonoBehaviour { public Texture texture { get; set; } }
}
