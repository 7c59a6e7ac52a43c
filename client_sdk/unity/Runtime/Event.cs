namespace Stridewire
{
    /// <summary>Something that happened. EventType lists the properties that each type uses.
    /// Ignore the others. Reading Text allocates a string, all other properties allocate nothing.
    /// </summary>
    public unsafe struct Event
    {
        private stridewire_event native;

        internal Event(stridewire_event polled)
        {
            native = polled;
        }

        public EventType Type { get { return native.type; } }

        public Status Status { get { return native.status; } }

        /// <summary>Number of the command that caused the event.</summary>
        public ulong Command { get { return native.command; } }

        /// <summary>Id of the request; 0 for a movement that the server inserted.</summary>
        public ulong RequestId { get { return native.request_id; } }

        public ulong Tick { get { return native.tick; } }

        /// <summary>Server time of the tick.</summary>
        public double TimeS { get { return native.time_s; } }

        /// <summary>World.Id of the world.</summary>
        public uint World { get { return native.world; } }

        public uint Avatar { get { return native.avatar; } }

        /// <summary>Index in the array that was passed to the command.</summary>
        public int ItemIndex { get { return (int)native.item_index; } }

        /// <summary>Number of items that the server executed.</summary>
        public int Accepted { get { return (int)native.accepted; } }

        public MovementKind Kind { get { return native.kind; } }

        public Foot Foot { get { return native.foot; } }

        /// <summary>How the request ended. Every accepted request has exactly one event in which it
        /// is not Outcome.None.</summary>
        public Outcome Outcome { get { return native.outcome; } }

        /// <summary>True: the session survived the reconnect.</summary>
        public bool Resumed { get { return native.resumed != 0; } }

        public bool Clamped { get { return native.clamped != 0; } }

        public bool CutShort { get { return native.cut_short != 0; } }

        public Position Position
        {
            get
            {
                fixed (double* p = native.position_m) return new Position(p[0], p[1], p[2]);
            }
        }

        public Position BasePosition
        {
            get
            {
                fixed (double* p = native.base_position_m) return new Position(p[0], p[1], p[2]);
            }
        }

        public double BaseHeadingRad { get { return native.base_heading_rad; } }

        /// <summary>Distance between the requested place and the nearest one within reach.
        /// </summary>
        public double MissedM { get { return native.missed_m; } }

        public double NearestLengthM { get { return native.nearest_length_m; } }

        public double SpeedMS { get { return native.speed_m_s; } }

        /// <summary>The server's text, or a description of Status if that is not Ok.</summary>
        public string Text
        {
            get
            {
                fixed (byte* text = native.text)
                {
                    if (text[0] != 0) return Client.FromUtf8(text);
                }
                return Status == Status.Ok ? "" : Client.StatusText(Status);
            }
        }
    }
}
