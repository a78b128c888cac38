using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Phasefront
{
    /// <summary>The result of a call: success or the kind of error.</summary>
    public enum Status : uint
    {
        /// <summary>The call succeeded.</summary>
        Ok = 0,
        /// <summary>A display whose physics is impossible or out of range.</summary>
        Display = 1,
        /// <summary>A frame, plane or image of the wrong shape or with unusable values.</summary>
        Frame = 2,
        /// <summary>A frame that is not later than the previous frame.</summary>
        Timestamp = 3,
        /// <summary>A setting or an argument that is invalid or cannot be planned for.</summary>
        Setting = 4,
        /// <summary>Data that is not a hologram network, or a network for another display.</summary>
        Network = 5,
        /// <summary>A file that cannot be read.</summary>
        File = 6,
        /// <summary>A call that a session cannot answer in its mode or state.</summary>
        Session = 7,
        /// <summary>A bug in Phasefront. Please report it.</summary>
        Internal = 8,
    }

    /// <summary>An error of Phasefront. Its message is one line that names the problem and the remedy.</summary>
    public sealed class PhasefrontException : Exception
    {
        /// <summary>The kind of error.</summary>
        public Status Status { get; }

        internal PhasefrontException(Status status, string message) : base(message) { Status = status; }

        internal static void Check(Status status)
        {
            if (status != Status.Ok) throw new PhasefrontException(status, Text.Read(Native.pf_last_error()));
        }
    }

    // C strings are UTF-8 and end with a zero.
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
        /// <summary>The version of the library, for example "0.1.0".</summary>
        public static string Version => Text.Read(Native.pf_version());

        /// <summary>The third-party notices of the library as Markdown. An app must show them with its own notices.</summary>
        public static string ThirdPartyNotices => Text.Read(Native.pf_third_party_notices());
    }
}
