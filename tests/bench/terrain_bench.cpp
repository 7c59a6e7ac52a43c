// Benchmarks of terrain: queries on uneven ground with slabs, and the largest possible terrain from
// its message to its index. Run them with stridewire-bench --benchmark_filter=terrain
#include <benchmark/benchmark.h>

#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "runtime/terrain/foot_support.h"
#include "stridewire/protocol/decode.h"
#include "stridewire/protocol/encoder.h"
#include "stridewire/runtime/terrain.h"

namespace stridewire {
namespace {

constexpr std::size_t kPlaces = 1024;

TerrainData MakeGround(std::int32_t samples, double cell_m, int slabs) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> height(-0.1f, 0.1f);
  const double extent_m = cell_m * (samples - 1);
  TerrainData data;
  HeightField field{{0, 0}, cell_m, samples, samples, {}};
  field.heights_m.resize(static_cast<std::size_t>(samples) * static_cast<std::size_t>(samples));
  for (float& h : field.heights_m) h = height(random);
  data.height_field = std::move(field);
  std::uniform_real_distribution<double> place(0.0, extent_m - 0.6);
  for (int s = 0; s < slabs; ++s) {
    const GroundPoint min{place(random), place(random)};
    data.boxes.push_back({min, {min.x + 0.6, min.z + 0.4}, 0.15});
  }
  return data;
}

/// Measures a query on a terrain of 64 m x 64 m with a sample every 0.25 m and 2,000 slabs.
template <typename Query>
void Ask(benchmark::State& state, const Query& query) {
  const auto terrain = Terrain::Make(MakeGround(257, 0.25, 2000));
  if (!terrain) {
    state.SkipWithError("no terrain");
    return;
  }
  std::mt19937 random(2);
  std::uniform_real_distribution<double> place(-1.0, 65.0);
  std::vector<GroundPoint> places(kPlaces);
  for (GroundPoint& p : places) p = {place(random), place(random)};
  std::size_t next = 0;
  for (auto _ : state) {
    const GroundPoint& p = places[next++ % kPlaces];
    benchmark::DoNotOptimize(query(**terrain, p.x, p.z));
  }
}

void HeightAt(benchmark::State& state) {
  Ask(state, [](const Terrain& t, double x, double z) { return t.HeightAt(x, z); });
}
BENCHMARK(HeightAt)->Name("terrain/height_at");

void SupportOf(benchmark::State& state) {
  Ask(state, [](const Terrain& t, double x, double z) {
    return stridewire::SupportOf(t, x, z, x + z, {0.18, 0.08, 0.05});
  });
}
BENCHMARK(SupportOf)->Name("terrain/support_of");

void HighestWithin(benchmark::State& state) {
  Ask(state, [](const Terrain& t, double x, double z) { return t.HighestWithin(x, z, 0.15); });
}
BENCHMARK(HighestWithin)->Name("terrain/highest_within_15_cm");

void MakeLargest(benchmark::State& state) {
  const TerrainData data = MakeGround(kMaxTerrainColumns, 0.25, int{kMaxTerrainBoxes});
  for (auto _ : state) {
    auto terrain = Terrain::Make(data);
    if (!terrain) state.SkipWithError("no terrain");
    benchmark::DoNotOptimize(terrain);
  }
}
BENCHMARK(MakeLargest)->Name("terrain/make_largest")->Unit(benchmark::kMillisecond);

void DecodeLargest(benchmark::State& state) {
  const TerrainData data = MakeGround(kMaxTerrainColumns, 0.25, int{kMaxTerrainBoxes});
  protocol::SetTerrain message{.seq = 1, .world = 1, .terrain = protocol::TerrainInfo{}};
  const HeightField& field = *data.height_field;
  message.terrain->height_field =
      protocol::HeightFieldInfo{{0, 0}, field.cell_m, 1024, 1024, field.heights_m};
  for (const TerrainBox& box : data.boxes) {
    message.terrain->boxes.push_back(
        {{box.min_m.x, box.min_m.z}, {box.max_m.x, box.max_m.z}, box.height_m});
  }
  std::vector<std::byte> frame;
  if (!protocol::Encoder().Encode(message, frame)) {
    state.SkipWithError("no message");
    return;
  }
  for (auto _ : state) {
    const auto view = protocol::ParseFrame(frame, protocol::Sender::kClient);
    auto decoded = protocol::DecodeMessage(*view);
    if (!decoded) state.SkipWithError("not decoded");
    benchmark::DoNotOptimize(decoded);
  }
  state.counters["frame_bytes"] = static_cast<double>(frame.size());
}
BENCHMARK(DecodeLargest)->Name("terrain/decode_largest")->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stridewire
