using System;
using System.Runtime.InteropServices;
using System.Text;

namespace Stridewire
{
    /// <summary>A call that failed.</summary>
    public sealed class StridewireException : Exception
    {
        internal StridewireException(Status status, string text)
            : base(Client.StatusName(status) + ": " + text)
        {
            Status = status;
        }

        public Status Status { get; private set; }
    }

    /// <summary>Settings of a client.</summary>
    public sealed class ClientOptions
    {
        /// <summary>Name in the server's log, 1 to 64 bytes.</summary>
        public string Name = "stridewire-csharp";

        /// <summary>Secret that the server may require, or null.</summary>
        public string Token;

        /// <summary>Delay of the render time behind the server time in seconds, at most 10. If it
        /// is negative, the client adapts the delay to the connection.</summary>
        public double RenderDelayS = -1.0;

        /// <summary>Poses stored per avatar, 2 to 4096.</summary>
        public int PoseHistory = 32;

        /// <summary>True: after a lost session, the client spawns its avatars again.</summary>
        public bool Respawn;

        /// <summary>Folder that caches motion libraries for PoseMode.Movement, or null.</summary>
        public string LibraryFolder;
    }

    /// <summary>Address of a server.</summary>
    public struct ServerAddress
    {
        /// <summary>Name or IP address.</summary>
        public string Host;

        public int Port;
    }

    /// <summary>A connection to a server. The client connects, and reconnects, in the background.
    /// Only WaitEvent and Dispose wait for the server. Commands are queued, and events report their
    /// results. Methods that fail throw StridewireException. Use a client, its worlds and their
    /// events on one thread.</summary>
    public sealed unsafe class Client : IDisposable
    {
        private const int MaxPolledEvents = 64;

        private readonly stridewire_event[] polled = new stridewire_event[MaxPolledEvents];
        private int polledCount;
        private int nextPolled;
        private ulong lastRequest;
        private readonly ClientHandle handle;

        /// <summary>Creates a client that is not connected. Throws VersionMismatch if the native
        /// library does not have the API version of this package.</summary>
        public Client(ClientOptions options = null)
        {
            options = options ?? new ClientOptions();
            string wrong = Abi.FindWrongLayout();
            if (wrong != null)
            {
                throw new StridewireException(
                    Status.VersionMismatch, "this platform lays out " + wrong + " differently");
            }
            stridewire_client_options native;
            Abi.stridewire_client_options_init(&native, (UIntPtr)sizeof(stridewire_client_options));
            if (native.abi_version != Abi.AbiVersion)
            {
                throw new StridewireException(
                    Status.VersionMismatch,
                    "the native library " + Version + " does not have ABI version " +
                    Abi.AbiVersion);
            }
            native.render_delay_s = options.RenderDelayS;
            native.pose_history = checked((uint)options.PoseHistory);
            native.respawn = ToByte(options.Respawn);
            fixed (byte* name = Utf8(options.Name), token = Utf8(options.Token),
                   folder = Utf8(options.LibraryFolder))
            {
                native.client_name = name;
                native.auth_token = token;
                native.library_folder = folder;
                IntPtr created;
                Check(Abi.stridewire_client_create(&native, &created));
                handle = new ClientHandle(created);
            }
        }

        /// <summary>Version of the native library, for example "0.1.0".</summary>
        public static string Version
        {
            get { return FromUtf8(Abi.stridewire_version()); }
        }

        public ClientState State
        {
            get
            {
                if (handle.IsClosed) return ClientState.Idle;
                return Abi.stridewire_client_get_state(handle);
            }
        }

        /// <summary>Describes the last error, see stridewire_client_last_error of the C API. Empty:
        /// there was none.</summary>
        public string LastError
        {
            get
            {
                const int bytes = 1100;
                byte* text = stackalloc byte[bytes];
                text[0] = 0;
                Abi.stridewire_client_last_error(Handle, text, (UIntPtr)bytes);
                return FromUtf8(text);
            }
        }

        internal ClientHandle Handle
        {
            get
            {
                if (handle.IsClosed) throw new ObjectDisposedException("Client");
                return handle;
            }
        }

        /// <summary>Ends the session and frees the client, which can take up to 1 s. If another
        /// thread waits for an event, the client is freed when the wait ends. The server removes
        /// the avatars that this client has spawned, except in persistent worlds.</summary>
        public void Dispose()
        {
            handle.Dispose();
        }

        /// <summary>Starts to connect. EventType.Connected reports success.</summary>
        public void Connect(string host, int port)
        {
            Connect(new ServerAddress { Host = host, Port = port });
        }

        /// <summary>Starts to connect to one of up to 16 servers that offer the same worlds. The
        /// client tries them in order. After a lost connection, it starts with the same server.
        /// </summary>
        public void Connect(params ServerAddress[] servers)
        {
            var hosts = new GCHandle[servers.Length];
            var native = new stridewire_address[servers.Length];
            try
            {
                for (int i = 0; i < servers.Length; ++i)
                {
                    hosts[i] = GCHandle.Alloc(Utf8(servers[i].Host), GCHandleType.Pinned);
                    native[i].host = (byte*)hosts[i].AddrOfPinnedObject();
                    native[i].port = checked((ushort)servers[i].Port);
                }
                fixed (stridewire_address* first = native)
                {
                    Check(Abi.stridewire_client_connect_any(
                        Handle, first, (UIntPtr)native.Length));
                }
            }
            finally
            {
                foreach (GCHandle host in hosts)
                {
                    if (host.IsAllocated) host.Free();
                }
            }
        }

        /// <summary>Ends the session. The client discards its worlds and poses.</summary>
        public void Disconnect()
        {
            Check(Abi.stridewire_client_disconnect(Handle));
        }

        /// <summary>Joins a world. Its methods may be called at once: the client delays their
        /// commands until the server has accepted the join.</summary>
        public World Join(string name, Role role = Role.Controller)
        {
            uint world;
            ulong command;
            fixed (byte* text = Utf8(name))
            {
                Check(Abi.stridewire_client_join_world(Handle, text, role, &world, &command));
            }
            return new World(this, world, name, command);
        }

        /// <summary>Gets the oldest event. Returns false if there is none.</summary>
        public bool PollEvent(out Event polledEvent)
        {
            if (nextPolled == polledCount)
            {
                UIntPtr count;
                fixed (stridewire_event* events = polled)
                {
                    Check(Abi.stridewire_client_poll_events(
                        Handle, events, (UIntPtr)MaxPolledEvents, &count));
                }
                nextPolled = 0;
                polledCount = (int)count;
            }
            if (nextPolled == polledCount)
            {
                polledEvent = default(Event);
                return false;
            }
            polledEvent = new Event(polled[nextPolled++]);
            return true;
        }

        /// <summary>Waits for an event for at most timeoutS, 0 to 3600 s. Returns false if none has
        /// arrived.</summary>
        public bool WaitEvent(double timeoutS)
        {
            if (nextPolled < polledCount) return true;
            Status status = Abi.stridewire_client_wait_event(Handle, timeoutS);
            if (status == Status.Timeout) return false;
            Check(status);
            return true;
        }

        /// <summary>Gets the server time at which to sample poses. Returns false before the first
        /// pose or pong.</summary>
        public bool TryGetRenderTime(out double timeS)
        {
            double result;
            Status status = Abi.stridewire_client_render_time(Handle, &result);
            timeS = result;
            if (status == Status.NotReady) return false;
            Check(status);
            return true;
        }

        /// <summary>Describes how the render time adapts to the connection.</summary>
        public Playout Playout
        {
            get
            {
                stridewire_playout native;
                Check(Abi.stridewire_client_get_playout(Handle, &native));
                return new Playout
                {
                    DelayS = native.delay_s,
                    TargetDelayS = native.target_delay_s,
                    JitterS = native.jitter_s,
                    NewestAgeS = native.newest_age_s,
                    DisplayedPoses = native.displayed_poses,
                    ExtrapolatedPoses = native.extrapolated_poses,
                    HeldPoses = native.held_poses,
                };
            }
        }

        internal static string StatusName(Status status)
        {
            return FromUtf8(Abi.stridewire_status_name(status));
        }

        internal static string StatusText(Status status)
        {
            return FromUtf8(Abi.stridewire_status_text(status));
        }

        internal static void Check(Status status)
        {
            if (status != Status.Ok) throw new StridewireException(status, StatusText(status));
        }

        internal static byte ToByte(bool value)
        {
            return value ? (byte)1 : (byte)0;
        }

        /// <summary>Returns a text with a terminating 0, or null.</summary>
        internal static byte[] Utf8(string text)
        {
            return text == null ? null : Encoding.UTF8.GetBytes(text + "\0");
        }

        internal static string FromUtf8(byte* text)
        {
            int length = 0;
            while (text[length] != 0) ++length;
            return Encoding.UTF8.GetString(text, length);
        }

        internal ulong NextRequest()
        {
            return ++lastRequest;
        }
    }
}
