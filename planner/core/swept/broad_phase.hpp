// Where a map could block a vehicle at all, whatever its heading: most ground needs no exact check.
//
// Around each block of cells a quadratic surface is taken off. Wheels and body follow planes
// exactly; four wheels at one distance from the middle follow a bowl; what a saddle costs is
// bounded by its curvature, and all else by the range of what is left. A step is looked for in what
// is left, too: the slope of the surface explains the rest of a climb. So a pose that is free may
// need an exact check, and none that is blocked goes without, but for climbs within a few
// millimetres of what is blocked: the check counts a little less of a step and of the slope around
// it, for what a map does not show (`cleared` of VehicleEnvelope).
#pragma once

#include <memory>
#include <optional>

#include "swept/map_blocks.hpp"
#include "swept/residual_ground.hpp"
#include "swept/screen_reach.hpp"
#include "swept/tracking_band.hpp"

namespace slopewise {

// The answer, a number for each block; blocks that nobody asked about need all checks.
struct ScreenedBlocks {
  Index rows, columns;
  std::vector<std::uint8_t> bits;  // what poses with their middle in a block may meet
  // How far a wheel around the block may climb or fall, beyond the slope there; how far it may
  // stand above the ground under its middle, likewise; inf where unknown [m]. Height below which a
  // wheel in the middle of the block stands, above the level of the facets; likewise [m]. Slope of
  // the ground around a wheel in the block [1]. Distance from any point of a block within which all
  // is known, at most the reach of the body [m].
  std::vector<float> relief, lift, stand, east, north, seen;

  ScreenedBlocks(Index block_rows, Index block_columns)
      : rows(block_rows), columns(block_columns), bits(count(), check_unknown | check_body),
        relief(count(), infinity), lift(count(), infinity), stand(count(), infinity),
        east(count()), north(count()), seen(count()) {}

 private:
  static constexpr float infinity = std::numeric_limits<float>::infinity();

  [[nodiscard]] std::size_t count() const noexcept {
    return static_cast<std::size_t>(rows * columns);
  }
};

class BroadPhase {
 public:
  // Of the part of a map around positions; `beside` as of BlockWindow.
  BroadPhase(const MapView& map, double resolution, const VehicleEnvelope& vehicle,
             const std::optional<BandWidth>& width, const Positions& at, double beside)
      : map_(map), vehicle_(vehicle), layout_(map, resolution, vehicle),
        band_(width, vehicle, resolution),
        sizes_(band_.widest_area(vehicle)),
        window_(map, layout_, sizes_, at, beside), limits_(sizes_, layout_.cells, resolution),
        blocks_(std::make_shared<ScreenedBlocks>(window_.rows.size(), window_.columns.size())),
        origin_x_(map.origin_x + corner(window_.columns) * resolution),
        origin_y_(map.origin_y + corner(window_.rows) * resolution) {
    const ScreenOffsets offsets(sizes_, layout_.cells, resolution);
    // What continues into unknown ground is the same wherever the window begins.
    const Index pad = 2 + std::max(offsets.widest, 2 * limits_.fit + 1);
    MapBlocks ground(map, resolution, (window_.rows.first - pad) * layout_.cells,
                     (window_.columns.first - pad) * layout_.cells, layout_.cells,
                     blocks_->rows + 2 * pad, blocks_->columns + 2 * pad,
                     static_cast<int>(limits_.fit) + 1);
    for (Index row = 0; row < blocks_->rows; ++row) screen(ground, offsets, pad, row);
    facets_ = std::make_shared<const FacetGrid>(std::move(ground.facets));
  }

  // The same ground for a vehicle that is longer or may be farther off its line: wheels feel what
  // they feel, and no body is cleared.
  [[nodiscard]] BroadPhase widened(const VehicleEnvelope& vehicle, BandWidth width) const {
    BroadPhase out = *this;
    out.vehicle_ = vehicle;
    out.band_ = TrackingBand(width, vehicle, 1.0 / map_.per_metre);
    out.sizes_ = out.band_.widest_area(vehicle);
    out.clears_bodies_ = false;
    return out;
  }

  // Are all blocks screened that poses at such positions ask about?
  [[nodiscard]] bool covers(const Positions& at) const {
    return window_.holds(BlockWindow(map_, layout_, sizes_, at, 0.0));
  }

  [[nodiscard]] const MapView& map() const noexcept { return map_; }
  [[nodiscard]] const VehicleEnvelope& vehicle() const noexcept { return vehicle_; }
  [[nodiscard]] const TrackingBand& band() const noexcept { return band_; }
  // Of the vehicle, as wide as its band is anywhere.
  [[nodiscard]] const VehicleEnvelope& sizes() const noexcept { return sizes_; }
  [[nodiscard]] const FacetGrid& facets() const noexcept { return *facets_; }
  [[nodiscard]] const BlockWindow& window() const noexcept { return window_; }
  [[nodiscard]] const ScreenLimits& limits() const noexcept { return limits_; }
  [[nodiscard]] const ScreenedBlocks& blocks() const noexcept { return *blocks_; }
  [[nodiscard]] ScreenedBlocks& blocks() noexcept { return *blocks_; }
  // What a pose may meet with its middle in a block, apart from wheels.
  [[nodiscard]] std::int32_t bits_of(std::int32_t block) const noexcept {
    return clears_bodies_ ? blocks_->bits[static_cast<std::size_t>(block)]
                          : check_unknown | check_body;
  }

  // Block at a place, in rows laid one behind the other; the nearest where it is beyond.
  [[nodiscard]] std::int32_t block_at(double x, double y) const noexcept {
    const auto rows = static_cast<double>(blocks_->rows - 1);
    const auto columns = static_cast<double>(blocks_->columns - 1);
    const double u = min_of(max_of(0.0, (x - origin_x_) * layout_.per_metre), columns);
    const double v = min_of(max_of(0.0, (y - origin_y_) * layout_.per_metre), rows);
    return static_cast<std::int32_t>(v) * static_cast<std::int32_t>(blocks_->columns) +
           static_cast<std::int32_t>(u);
  }

  // Height below which a wheel with its middle there stands, above the level of the facets [m].
  [[nodiscard]] double stands_below(const Place& at) const noexcept {
    const std::int32_t n = block_at(at.x, at.y);
    const auto columns = static_cast<std::int32_t>(blocks_->columns), row = n / columns;
    const auto block = static_cast<std::size_t>(n);
    const double edge = 1.0 / layout_.per_metre;
    const double x = at.x - origin_x_ - (static_cast<double>(n - row * columns) + 0.5) * edge;
    const double y = at.y - origin_y_ - (static_cast<double>(row) + 0.5) * edge;
    return static_cast<double>(blocks_->stand[block]) +
           static_cast<double>(blocks_->east[block]) * x +
           static_cast<double>(blocks_->north[block]) * y;
  }

 private:
  // Of the first block, from the centre of the first cell of the map [cells].
  [[nodiscard]] double corner(BlockSpan span) const noexcept {
    return static_cast<double>(span.first * layout_.cells) - 0.5;
  }

  // Judge blocks of a row by the ground around them, a tile of columns at a time.
  void screen(const MapBlocks& ground, const ScreenOffsets& offsets, Index pad,
              Index row) noexcept {
    const BlockSpan span = window_.screened[static_cast<std::size_t>(row)];
    for (Index first = span.first; first < span.end; first += wide) {
      const Index lanes = std::min<Index>(wide, span.end - first);
      const Index out = row * blocks_->columns + first;
      ResidualGround residual(ground, (row + pad) * ground.columns + pad + first, lanes, limits_);
      residual.visit_body(offsets.body);
      residual.judge_body(blocks_->bits.data() + out);
      residual.give_slopes(blocks_->east.data() + out, blocks_->north.data() + out);
      if (offsets.wheel.empty()) {
        std::fill_n(blocks_->relief.data() + out, lanes, 0.0F);
        std::fill_n(blocks_->lift.data() + out, lanes, 0.0F);
      } else {
        residual.visit_wheel(offsets.wheel);
        residual.judge_wheel(blocks_->relief.data() + out, blocks_->lift.data() + out,
                             blocks_->stand.data() + out);
      }
      residual.find_unknown(offsets.sight, static_cast<float>(sizes_.sight()),
                            blocks_->seen.data() + out, blocks_->bits.data() + out);
    }
  }

  MapView map_;
  VehicleEnvelope vehicle_;
  BlockLayout layout_;
  TrackingBand band_;
  VehicleEnvelope sizes_;
  BlockWindow window_;
  ScreenLimits limits_;
  std::shared_ptr<ScreenedBlocks> blocks_;
  double origin_x_, origin_y_;  // corner of block [0, 0] [m]
  std::shared_ptr<const FacetGrid> facets_;
  bool clears_bodies_ = true;
};

}  // namespace slopewise
