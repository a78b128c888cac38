using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Phasefront
{
    /// <summary>Whether a call did what it says, and else why not.</summary>
    public enum Status : uint
    {
        /// <summary>It did.</summary>
        Ok = 0,
        /// <summary>A display whose physics is impossible or out of range.</summary>
        Display = 1,
        /// <summary>A frame, plane or image of the wrong shape or with unusable values.</summary>
        Frame = 2,
        /// <summary>A frame that is not later than the last one.</summary>
        Timestamp = 3,
        /// <summary>A setting or an argument that cannot be meant or planned for.</summary>
        Setting = 4,
        /// <summary>What is not a hologram network, or one for another display.</summary>
        Network = 5,
        /// <summary>A file that cannot be read.</summary>
        File = 6,
        /// <summary>A call that a session cannot answer in its mode or state.</summary>
        Session = 7,
        /// <summary>A fault of Phasefront; please report it.</summary>
        Internal = 8,
    }

    /// <summary>Why Phasefront refused to go on: one line that names what is wrong and what would be right.</summary>
    public sealed class PhasefrontException : Exception
    {
        /// <summary>What kind of fault it is.</summary>
        public Status Status { get; }

        internal PhasefrontException(Status status, string message) : base(message) { Status = status; }

        internal static void Check(Status status)
        {
            if (status != Status.Ok) throw new PhasefrontException(status, Text.Read(Native.pf_last_error()));
        }
    }

    // Text of C is UTF-8 with a zero behind it.
    internal static class Text
    {
        public static byte[] Write(string text)
        {
            if (text == null) throw new ArgumentNullException(nameof(text));
            var bytes = new byte[Encoding.UTF8.GetByteCount(text) + 1];
            Encoding.UTF8.GetBytes(text, 0, text.Length, bytes, 0);
            return bytes;
        }

        public static string Read(IntPtr text)
        {
            var length = 0;
            while (Marshal.ReadByte(text, length) != 0) length++;
            var bytes = new byte[length];
            Marshal.Copy(text, bytes, 0, length);
            return Encoding.UTF8.GetString(bytes);
        }
    }

    /// <summary>The library.</summary>
    public static class Library
    {
        /// <summary>Its version, as "0.1.0".</summary>
        public static string Version => Text.Read(Native.pf_version());
    }
}
