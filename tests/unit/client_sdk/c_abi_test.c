/* Pins the layout of every public struct to STRIDEWIRE_ABI_VERSION, for 64-bit targets. If one of
   these assertions fails, increase the version and update the numbers. */
#include <stddef.h>
#include <stdint.h>

#include "stridewire/client.h"

#define SIZE(type, bytes) _Static_assert(sizeof(type) == (bytes), "size of " #type)
#define OFFSET(type, field, bytes) \
  _Static_assert(offsetof(type, field) == (bytes), "offset of " #type "." #field)

_Static_assert(STRIDEWIRE_ABI_VERSION == 6, "the numbers below belong to this version");

#if UINTPTR_MAX == UINT64_MAX

SIZE(stridewire_client_options, 104);
OFFSET(stridewire_client_options, struct_bytes, 0);
OFFSET(stridewire_client_options, abi_version, 8);
OFFSET(stridewire_client_options, max_events, 12);
OFFSET(stridewire_client_options, max_commands, 16);
OFFSET(stridewire_client_options, pose_history, 20);
OFFSET(stridewire_client_options, max_command_bytes, 24);
OFFSET(stridewire_client_options, max_pose_bytes, 32);
OFFSET(stridewire_client_options, render_delay_s, 40);
OFFSET(stridewire_client_options, connect_timeout_s, 48);
OFFSET(stridewire_client_options, ping_interval_s, 56);
OFFSET(stridewire_client_options, seed, 64);
OFFSET(stridewire_client_options, client_name, 72);
OFFSET(stridewire_client_options, auth_token, 80);
OFFSET(stridewire_client_options, respawn, 88);
OFFSET(stridewire_client_options, library_folder, 96);

SIZE(stridewire_address, 16);
OFFSET(stridewire_address, host, 0);
OFFSET(stridewire_address, port, 8);

SIZE(stridewire_spawn, 40);
OFFSET(stridewire_spawn, avatar, 0);
OFFSET(stridewire_spawn, position_m, 8);
OFFSET(stridewire_spawn, heading_rad, 32);

SIZE(stridewire_movement, 144);
OFFSET(stridewire_movement, avatar, 0);
OFFSET(stridewire_movement, request_id, 8);
OFFSET(stridewire_movement, type, 16);
OFFSET(stridewire_movement, foot, 20);
OFFSET(stridewire_movement, length_m, 24);
OFFSET(stridewire_movement, side_m, 32);
OFFSET(stridewire_movement, height_m, 40);
OFFSET(stridewire_movement, turn_rad, 48);
OFFSET(stridewire_movement, seconds, 56);
OFFSET(stridewire_movement, has_side, 64);
OFFSET(stridewire_movement, has_at, 65);
OFFSET(stridewire_movement, has_heading, 66);
OFFSET(stridewire_movement, at_m, 72);
OFFSET(stridewire_movement, heading_rad, 96);
OFFSET(stridewire_movement, waypoints_m, 104);
OFFSET(stridewire_movement, waypoint_count, 112);
OFFSET(stridewire_movement, has_speed, 120);
OFFSET(stridewire_movement, speed_m_s, 128);
OFFSET(stridewire_movement, interrupt, 136);
OFFSET(stridewire_movement, exact_only, 140);
OFFSET(stridewire_movement, allow_nearest, 141);

SIZE(stridewire_height_field, 40);
OFFSET(stridewire_height_field, origin_m, 0);
OFFSET(stridewire_height_field, cell_m, 16);
OFFSET(stridewire_height_field, columns, 24);
OFFSET(stridewire_height_field, rows, 28);
OFFSET(stridewire_height_field, heights_m, 32);

SIZE(stridewire_terrain_box, 40);
OFFSET(stridewire_terrain_box, min_m, 0);
OFFSET(stridewire_terrain_box, max_m, 16);
OFFSET(stridewire_terrain_box, height_m, 32);

SIZE(stridewire_terrain_def, 24);
OFFSET(stridewire_terrain_def, height_field, 0);
OFFSET(stridewire_terrain_def, boxes, 8);
OFFSET(stridewire_terrain_def, box_count, 16);

SIZE(stridewire_layer, 48);
OFFSET(stridewire_layer, avatar, 0);
OFFSET(stridewire_layer, name, 8);
OFFSET(stridewire_layer, fade_out, 16);
OFFSET(stridewire_layer, weight, 24);
OFFSET(stridewire_layer, blend_s, 32);
OFFSET(stridewire_layer, speed, 40);

SIZE(stridewire_planting, 24);
OFFSET(stridewire_planting, avatars, 0);
OFFSET(stridewire_planting, avatar_count, 8);
OFFSET(stridewire_planting, enabled, 16);

SIZE(stridewire_rate_ring, 16);
OFFSET(stridewire_rate_ring, to_m, 0);
OFFSET(stridewire_rate_ring, every_n_ticks, 8);

SIZE(stridewire_region, 56);
OFFSET(stridewire_region, x, 0);
OFFSET(stridewire_region, z, 8);
OFFSET(stridewire_region, radius_m, 16);
OFFSET(stridewire_region, leave_m, 24);
OFFSET(stridewire_region, rings, 32);
OFFSET(stridewire_region, ring_count, 40);
OFFSET(stridewire_region, ring_details, 48);

SIZE(stridewire_observation, 40);
OFFSET(stridewire_observation, mode, 0);
OFFSET(stridewire_observation, every_n_ticks, 4);
OFFSET(stridewire_observation, with_events, 6);
OFFSET(stridewire_observation, avatars, 8);
OFFSET(stridewire_observation, avatar_count, 16);
OFFSET(stridewire_observation, detail, 24);
OFFSET(stridewire_observation, region, 32);

SIZE(stridewire_parameters, 64);
OFFSET(stridewire_parameters, values, 0);
OFFSET(stridewire_parameters, names, 56);
OFFSET(stridewire_parameters, count, 63);

SIZE(stridewire_event, 520);
OFFSET(stridewire_event, type, 0);
OFFSET(stridewire_event, status, 4);
OFFSET(stridewire_event, command, 8);
OFFSET(stridewire_event, request_id, 16);
OFFSET(stridewire_event, tick, 24);
OFFSET(stridewire_event, time_s, 32);
OFFSET(stridewire_event, world, 40);
OFFSET(stridewire_event, avatar, 44);
OFFSET(stridewire_event, item_index, 48);
OFFSET(stridewire_event, accepted, 52);
OFFSET(stridewire_event, kind, 56);
OFFSET(stridewire_event, foot, 60);
OFFSET(stridewire_event, group, 64);
OFFSET(stridewire_event, resumed, 68);
OFFSET(stridewire_event, extrapolated, 69);
OFFSET(stridewire_event, clamped, 70);
OFFSET(stridewire_event, cut_short, 71);
OFFSET(stridewire_event, position_m, 72);
OFFSET(stridewire_event, base_position_m, 96);
OFFSET(stridewire_event, base_heading_rad, 120);
OFFSET(stridewire_event, requested, 128);
OFFSET(stridewire_event, applied, 192);
OFFSET(stridewire_event, rtt_s, 256);
OFFSET(stridewire_event, dropped_batches, 264);
OFFSET(stridewire_event, dropped_events, 272);
OFFSET(stridewire_event, events_dropped_before, 280);
OFFSET(stridewire_event, text, 288);
OFFSET(stridewire_event, missed_m, 448);
OFFSET(stridewire_event, missed_rad, 456);
OFFSET(stridewire_event, nearest_length_m, 464);
OFFSET(stridewire_event, nearest_side_m, 472);
OFFSET(stridewire_event, nearest_height_m, 480);
OFFSET(stridewire_event, nearest_turn_rad, 488);
OFFSET(stridewire_event, nearest_heading_rad, 496);
OFFSET(stridewire_event, speed_m_s, 504);
OFFSET(stridewire_event, outcome, 512);

SIZE(stridewire_joint, 84);
OFFSET(stridewire_joint, name, 0);
OFFSET(stridewire_joint, parent, 68);
OFFSET(stridewire_joint, offset_m, 72);

SIZE(stridewire_end_site, 16);
OFFSET(stridewire_end_site, joint, 0);
OFFSET(stridewire_end_site, offset_m, 4);

SIZE(stridewire_leg, 40);
OFFSET(stridewire_leg, hip, 0);
OFFSET(stridewire_leg, knee, 4);
OFFSET(stridewire_leg, ankle, 8);
OFFSET(stridewire_leg, ball, 12);
OFFSET(stridewire_leg, ball_offset_m, 16);
OFFSET(stridewire_leg, toe_tip_offset_m, 28);

SIZE(stridewire_skeleton, 168);
OFFSET(stridewire_skeleton, joint_count, 0);
OFFSET(stridewire_skeleton, end_site_count, 4);
OFFSET(stridewire_skeleton, legs, 8);
OFFSET(stridewire_skeleton, tick_hz, 88);
OFFSET(stridewire_skeleton, library_hash, 96);

SIZE(stridewire_skeleton_buffers, 32);
OFFSET(stridewire_skeleton_buffers, joints, 0);
OFFSET(stridewire_skeleton_buffers, joint_capacity, 8);
OFFSET(stridewire_skeleton_buffers, end_sites, 16);
OFFSET(stridewire_skeleton_buffers, end_site_capacity, 24);

SIZE(stridewire_layer_name, 65);
OFFSET(stridewire_layer_name, name, 0);

SIZE(stridewire_terrain, 40);
OFFSET(stridewire_terrain, origin_m, 0);
OFFSET(stridewire_terrain, cell_m, 16);
OFFSET(stridewire_terrain, columns, 24);
OFFSET(stridewire_terrain, rows, 28);
OFFSET(stridewire_terrain, box_count, 32);

SIZE(stridewire_terrain_buffers, 32);
OFFSET(stridewire_terrain_buffers, heights_m, 0);
OFFSET(stridewire_terrain_buffers, height_capacity, 8);
OFFSET(stridewire_terrain_buffers, boxes, 16);
OFFSET(stridewire_terrain_buffers, box_capacity, 24);

SIZE(stridewire_pose, 72);
OFFSET(stridewire_pose, kind, 0);
OFFSET(stridewire_pose, joint_count, 4);
OFFSET(stridewire_pose, tick, 8);
OFFSET(stridewire_pose, time_s, 16);
OFFSET(stridewire_pose, held_s, 24);
OFFSET(stridewire_pose, root_position_m, 32);
OFFSET(stridewire_pose, discontinuity, 44);
OFFSET(stridewire_pose, standing, 45);
OFFSET(stridewire_pose, detail, 46);
OFFSET(stridewire_pose, rotations_xyzw, 48);
OFFSET(stridewire_pose, joint_capacity, 56);
OFFSET(stridewire_pose, segment, 64);

SIZE(stridewire_playout, 80);
OFFSET(stridewire_playout, delay_s, 0);
OFFSET(stridewire_playout, target_delay_s, 8);
OFFSET(stridewire_playout, interval_s, 16);
OFFSET(stridewire_playout, jitter_s, 24);
OFFSET(stridewire_playout, worst_jitter_s, 32);
OFFSET(stridewire_playout, newest_age_s, 40);
OFFSET(stridewire_playout, displayed_poses, 48);
OFFSET(stridewire_playout, extrapolated_poses, 56);
OFFSET(stridewire_playout, held_poses, 64);
OFFSET(stridewire_playout, jumps, 72);

SIZE(stridewire_statistics, 136);
OFFSET(stridewire_statistics, bytes_received, 0);
OFFSET(stridewire_statistics, bytes_sent, 8);
OFFSET(stridewire_statistics, batches_received, 16);
OFFSET(stridewire_statistics, poses_received, 24);
OFFSET(stridewire_statistics, poses_refused, 32);
OFFSET(stridewire_statistics, batches_missing, 40);
OFFSET(stridewire_statistics, dropped_batches, 48);
OFFSET(stridewire_statistics, events_received, 56);
OFFSET(stridewire_statistics, events_dropped, 64);
OFFSET(stridewire_statistics, commands_sent, 72);
OFFSET(stridewire_statistics, commands_resent, 80);
OFFSET(stridewire_statistics, commands_waiting, 88);
OFFSET(stridewire_statistics, connects, 96);
OFFSET(stridewire_statistics, resumes, 104);
OFFSET(stridewire_statistics, connect_failures, 112);
OFFSET(stridewire_statistics, buffered_bytes, 120);
OFFSET(stridewire_statistics, rtt_s, 128);

SIZE(stridewire_status, 4);
SIZE(stridewire_client_state, 4);
SIZE(stridewire_role, 4);
SIZE(stridewire_movement_type, 4);
SIZE(stridewire_foot, 4);
SIZE(stridewire_interrupt, 4);
SIZE(stridewire_pose_mode, 4);
SIZE(stridewire_pose_detail, 4);
SIZE(stridewire_event_type, 4);
SIZE(stridewire_outcome, 4);
SIZE(stridewire_movement_kind, 4);
SIZE(stridewire_pose_kind, 4);

#endif
