// The correction of one foot (see FootTrajectory), written once for two number types: double for
// the planner and Float, a SIMD vector of floats, for the kernels.
//
// plant_feet.cpp and foot_plant-inl.h include this file inside a namespace, so it has no include
// guard. Before that, they define STRIDEWIRE_INLINE and the arithmetic of their number type:
// Constant, Select, Min, Max, DivideBy, WrapAngle, EaseOut and EaseOutSlope. The order of additions
// in OnePlusTwice(x) = 1 + 2x and AddBoth(a, b, c) = a + b + c differs between the number types.
// Another order would change the poses of existing movements in their last bits.
//
// A `Timing` has the members time_s, start_offset_s, duration_s, ease_out_s and extra_turn, and the
// functions OfDuration(x) = x / duration_s and OfEaseOut(x) = x / ease_out_s.

// Data of a FootTrajectory and its FootResidual.
template <typename Number, typename Vector>
struct TrajectoryOf {
  Vector from, to, release_offset, release_velocity, land_offset, land_velocity, mid_swing_offset;
  Number height[3], turn[3], level[4];
  Vector residual_offset, residual_velocity, root_shift;
  Number from_heading, to_heading, release_turn, root_weight, residual_turn, residual_turn_s;
  Number lift[3];
  Number residual_over_s, release_s, land_s;
  Number settle_lift;
  Number locks_height;  // 1 if FootTrajectory::locks_height, else 0.
};

// The offset of a foot, and intermediate values from which CorrectTrajectory computes the turn of
// the foot.
template <typename Number, typename Vector>
struct OffsetOf {
  Vector offset;
  Number swing;           // Elapsed fraction of the swing, as in CorrectionOf.
  Number settled;         // Fraction of the difference pose that has faded out.
  Number residual;        // Remaining fraction of the residual.
  Number residual_slope;  // Time in seconds by which the velocity of the residual is multiplied.
};

template <typename Number, typename Vector>
struct CorrectionOf {
  Vector offset;
  Number swing;       // Elapsed fraction of the swing: 0 before release, 1 after landing.
  Number turned;      // Fraction of the change in heading and tilt that is complete.
  Number tilted;      // Fraction of the ground's slope by which the foot tilts.
  Number turn;        // Turn that is added to the heading, in radians.
  Number free_turn;   // Turn that would be added if the heading were not locked.
  Vector root_shift;  // Part of FootTrajectory::root_shift_m that is complete.
};

// Returns the fraction of a lift that is added when the fraction `swing` of the swing has elapsed.
template <typename Number>
STRIDEWIRE_INLINE Number LiftShareOf(const LiftCurve& curve, Number swing) {
  return (Constant<Number>(1.0) -
          EaseOut(DivideBy(swing - Constant<Number>(curve.begin), curve.top - curve.begin))) *
         EaseOut(DivideBy(swing - Constant<Number>(curve.falls), curve.end - curve.falls));
}

// Returns the fraction of FootTrajectory::settle_lift_m that is added when the fraction `settled`
// of the difference pose has faded out.
template <typename Number>
STRIDEWIRE_INLINE Number SettleLiftShareOf(Number settled) {
  return Constant<Number>(4.0) * settled * (Constant<Number>(1.0) - settled);
}

// Returns the fraction of the root's descent (FootTrajectory::root_shift_m.y) that is complete
// after the fraction `elapsed` of the movement.
template <typename Number>
STRIDEWIRE_INLINE Number RootSinkShareOf(Number elapsed) {
  return Constant<Number>(1.0) -
         EaseOut(DivideBy(elapsed - Constant<Number>(kRootSinkStart), 1.0 - kRootSinkStart));
}

// Returns the part of the body's extra turn (Movement::extra_turn_rad) that is complete at a time.
template <typename Number, typename Timing>
STRIDEWIRE_INLINE Number ExtraTurnAt(const Timing& timing, Number at_s) {
  return timing.extra_turn * (Constant<Number>(1.0) - EaseOut(timing.OfDuration(at_s)));
}

// Returns the offset of a foot. It does not depend on the heading of the blended foot.
template <typename Number, typename Vector, typename Timing>
STRIDEWIRE_INLINE OffsetOf<Number, Vector> OffsetTrajectory(
    const Timing& timing, const TrajectoryOf<Number, Vector>& trajectory, const Vector& ball) {
  const Number zero = Constant<Number>(0.0);
  const Number one = Constant<Number>(1.0);
  const Number t = timing.time_s;
  const auto has_landed = t >= trajectory.land_s;
  const auto is_planted = (t <= trajectory.release_s) || has_landed;
  const Number length = Select(is_planted, one, trajectory.land_s - trajectory.release_s);
  const Number s =
      Select(has_landed, one, Select(is_planted, zero, (t - trajectory.release_s) / length));
  const Number r = one - s;

  // The ball of a planted foot stays on its footprint. The offset of a swinging foot follows a
  // cubic Hermite curve.
  const Vector print = Select(has_landed, trajectory.to, trajectory.from);
  const Number across = Constant<Number>(4.0) * s * r;
  const Vector flying =
      trajectory.release_offset * (OnePlusTwice(s) * r * r) +
      trajectory.land_offset * (s * s * OnePlusTwice(r)) +
      (trajectory.release_velocity * r - trajectory.land_velocity * s) * (length * s * r) +
      trajectory.mid_swing_offset * (across * across);
  Vector offset = Select(is_planted, print - ball, flying);

  // A foot that steps up rises early in the swing; a foot that steps down descends late.
  const Number since_s = t - timing.start_offset_s;
  const Number settled = one - EaseOut(timing.OfEaseOut(since_s));
  const auto& height = trajectory.height;
  const Number rise = height[2] - height[1];
  const Number rise_start = Select(rise > zero, zero, Constant<Number>(kSinkStart));
  const Number risen = one - EaseOut(DivideBy(s - rise_start, 1.0 - kSinkStart));
  const auto& level = trajectory.level;
  const Number u = timing.OfDuration(t);
  const Number locked = Select(trajectory.locks_height > zero, offset.y, zero);
  offset.y = locked + height[0] + settled * (height[1] - height[0]) + rise * risen +
             u * (level[0] + u * (level[1] + u * (level[2] + u * level[3]))) +
             trajectory.settle_lift * SettleLiftShareOf(settled) +
             trajectory.lift[0] * LiftShareOf(kLiftCurves[0], s) +
             trajectory.lift[1] * LiftShareOf(kLiftCurves[1], s) +
             trajectory.lift[2] * LiftShareOf(kLiftCurves[2], s);

  const Number faded = since_s / trajectory.residual_over_s;
  const Number value = EaseOut(faded);
  const Number slope = trajectory.residual_over_s * EaseOutSlope(faded);
  offset =
      AddBoth(offset, trajectory.residual_offset * value, trajectory.residual_velocity * slope);
  return {offset, s, settled, value, slope};
}

template <typename Number, typename Vector, typename Timing>
STRIDEWIRE_INLINE CorrectionOf<Number, Vector> CorrectTrajectory(
    const Timing& timing, const TrajectoryOf<Number, Vector>& trajectory, const Vector& ball,
    Number heading, Number flatness) {
  const Number one = Constant<Number>(1.0);
  const Number t = timing.time_s;
  const auto has_landed = t >= trajectory.land_s;
  const auto is_planted = (t <= trajectory.release_s) || has_landed;
  const OffsetOf<Number, Vector> at = OffsetTrajectory(timing, trajectory, ball);
  const Number s = at.swing;
  CorrectionOf<Number, Vector> c;
  c.offset = at.offset;
  c.swing = s;

  // The extra turn of the body does not rotate a standing foot. During its swing, the foot turns by
  // the angle by which the body will have turned when the foot lands.
  c.turned = one - EaseOut(s);
  const Number late =
      EaseOut(DivideBy(s - Constant<Number>(kLandingTiltStart), 1.0 - kLandingTiltStart));
  const Number across = Constant<Number>(4.0) * s * (one - s);
  const Number swung = Select(s > Constant<Number>(0.5), late, across * across);
  c.tilted = one - Constant<Number>(1.0 - kSwingTilt) * swung;
  const auto& turn = trajectory.turn;
  Number free = turn[0] + at.settled * (turn[1] - turn[0]) + c.turned * (turn[2] - turn[1]);
  free = free + (ExtraTurnAt(timing, Min(trajectory.land_s, timing.duration_s)) * c.turned -
                 ExtraTurnAt(timing, t));
  free = AddBoth(free, at.residual * trajectory.residual_turn,
                 at.residual_slope * trajectory.residual_turn_s);
  c.free_turn = free;

  // The heading of a standing foot is locked while its sole is on the ground, and free when its
  // heel is up. Seen from above, a foot on its toes is too short to have a heading. Once the ankle
  // has passed the ball, the direction from ankle to ball is reversed, so it is not a heading
  // either.
  const Number print_heading = Select(has_landed, trajectory.to_heading, trajectory.from_heading);
  const Number error = WrapAngle(print_heading - heading - free);
  const Number ahead =
      EaseOut(DivideBy(Max(error, -error) - Constant<Number>(kAheadRad), kReversedRad - kAheadRad));
  const Number lock =
      ahead * (one - EaseOut(DivideBy(flatness - Constant<Number>(kHeelUp), kSoleDown - kHeelUp)));
  c.turn =
      Select(is_planted, free + lock * error, free + (one - c.turned) * trajectory.release_turn);
  c.root_shift = trajectory.root_shift * (one - EaseOut(timing.OfDuration(t)));
  c.root_shift.y = trajectory.root_shift.y * RootSinkShareOf(timing.OfDuration(t));
  return c;
}

// Data of FootPlan::root_residual_m and FootPlan::root_approach.
template <typename Number, typename Vector>
struct RootResidualOf {
  Vector offset, velocity;
  Vector approach, approach_velocity;
  Number approach_over_s;
};

// Adds the remaining parts of the root's residual and of its approach to its shift. The vertical
// residual fades out over a fraction of the movement (kRootRisePart), because a body rises for as
// long as its leg extends.
template <typename Number, typename Vector, typename Timing>
STRIDEWIRE_INLINE Vector AddRootResidual(const Vector& shift, const Timing& timing,
                                         const RootResidualOf<Number, Vector>& residual) {
  const Number since_s = timing.time_s - timing.start_offset_s;
  const Number over_s = Max(residual.approach_over_s, timing.ease_out_s);
  const Number flat =
      EaseOut(since_s / Max(Constant<Number>(kRootShiftS), residual.approach_over_s));
  const Number rise = EaseOut(since_s / Max(Constant<Number>(kRootShiftS),
                                            Constant<Number>(kRootRisePart) * timing.duration_s));
  // The difference pose still displaces the root by the fraction `blended` of the approach. The
  // required fraction is `part`, so only the rest, `part - blended`, is added.
  const Number faded = timing.OfEaseOut(since_s);
  const Number blended = EaseOut(faded);
  const Number blended_s = timing.ease_out_s * EaseOutSlope(faded);
  const Number part = EaseOut(since_s / over_s);
  const Number part_s = over_s * EaseOutSlope(since_s / over_s);
  const Vector& offset = residual.offset;
  const Vector& velocity = residual.velocity;
  const Vector approached =
      residual.approach * (part - blended) + residual.approach_velocity * (part_s - blended_s);
  return AddBoth(shift + approached, Vector{flat * offset.x, rise * offset.y, flat * offset.z},
                 Vector{part_s * velocity.x, blended_s * velocity.y, part_s * velocity.z});
}

// Data of FootPlan::root_dip.
template <typename Number>
struct RootDipOf {
  Number depth, speed, release_s, over_s;
};

// Returns by how much a dip lowers the root: a cubic Hermite curve from 0 to the depth and speed at
// the release, and another one back to 0. The speed is 0 at both ends. It is continuous at the
// release, so the root sinks further for a short time.
template <typename Number, typename Timing>
STRIDEWIRE_INLINE Number DipAt(const Timing& timing, const RootDipOf<Number>& dip) {
  const Number one = Constant<Number>(1.0);
  const auto is_rising = timing.time_s > dip.release_s;
  const Number length_s = Max(Select(is_rising, dip.over_s, dip.release_s - timing.start_offset_s),
                              Constant<Number>(kLeastDipS));
  const Number from_release_s = timing.time_s - dip.release_s;
  const Number away = Min(one, Max(from_release_s, -from_release_s) / length_s);
  const Number left = one - away;
  const Number speed = Select(is_rising, dip.speed, -dip.speed);
  return left * left * (dip.depth * OnePlusTwice(away) + speed * (length_s * away));
}
