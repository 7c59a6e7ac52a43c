using System;
using System.Runtime.InteropServices;

namespace Stridewire
{
    /// <summary>Owns a native client. The runtime frees it after the last call on it has returned,
    /// even if the Client is disposed or collected during a call.</summary>
    internal sealed class ClientHandle : SafeHandle
    {
        internal ClientHandle(IntPtr client) : base(IntPtr.Zero, true)
        {
            SetHandle(client);
        }

        public override bool IsInvalid
        {
            get { return handle == IntPtr.Zero; }
        }

        protected override bool ReleaseHandle()
        {
            Abi.stridewire_client_destroy(handle);
            return true;
        }
    }
}
