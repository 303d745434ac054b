// Arrays that Python will own.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <bit>
#include <cstddef>
#include <memory>
#include <mutex>
#include <new>
#include <vector>

namespace slopewise {

namespace nb = nanobind;

// Memory of an array, from the start of a cache line on.
struct Block {
  static constexpr std::align_val_t line{64};
  std::size_t size;
  void* memory;

  explicit Block(std::size_t bytes) : size(bytes), memory(::operator new(bytes, line)) {}
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;
  ~Block() { ::operator delete(memory, line); }
};

// Blocks that no array holds any more, for the next ones. A process gets fresh memory page by page,
// each zeroed on its first touch: for the arrays of a thousand candidates that takes as long as
// planning them. A block that comes back is warm.
class IdleBlocks {
 public:
  static std::unique_ptr<Block> take(std::size_t bytes) {
    if (bytes < small) return std::make_unique<Block>(bytes);
    // So that blocks fit batches of about the same size as well.
    const std::size_t step = std::bit_floor(bytes) / 4, size = (bytes + step - 1) / step * step;
    IdleBlocks& idle = shared();
    const std::scoped_lock lock(idle.mutex_);
    for (std::size_t n = idle.blocks_.size(); n-- > 0;) {
      if (idle.blocks_[n]->size != size) continue;
      auto found = std::move(idle.blocks_[n]);
      idle.blocks_.erase(idle.blocks_.begin() + static_cast<std::ptrdiff_t>(n));
      return found;
    }
    return std::make_unique<Block>(size);
  }

  static void give_back(std::unique_ptr<Block> block) {
    if (block->size < small) return;
    IdleBlocks& idle = shared();
    const std::scoped_lock lock(idle.mutex_);
    if (idle.blocks_.size() == most) idle.blocks_.erase(idle.blocks_.begin());
    idle.blocks_.push_back(std::move(block));
  }

 private:
  static constexpr std::size_t small = 1 << 17;  // the allocator keeps less warm by itself [bytes]
  static constexpr std::size_t most = 8;         // blocks

  static IdleBlocks& shared() {
    static auto* idle = new IdleBlocks;  // arrays may outlive any static
    return *idle;
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<Block>> blocks_;
};

template <class T>
using Made = nb::ndarray<nb::numpy, T, nb::c_contig>;

// An array of numbers that are whatever was there before: the caller writes all of them.
template <class T = double, class... Sizes>
Made<T> make_rows(Sizes... sizes) {
  const std::size_t count = (std::size_t{1} * ... * static_cast<std::size_t>(sizes));
  auto block = IdleBlocks::take(count * sizeof(T));
  auto* numbers = static_cast<T*>(block->memory);
  const nb::capsule owner(block.get(), [](void* of) noexcept {
    IdleBlocks::give_back(std::unique_ptr<Block>(static_cast<Block*>(of)));
  });
  block.release();
  return Made<T>(numbers, {static_cast<std::size_t>(sizes)...}, owner);
}

// An array of zeros.
template <class T = double, class... Sizes>
Made<T> make_array(Sizes... sizes) {
  Made<T> made = make_rows<T>(sizes...);
  std::fill_n(made.data(), made.size(), T{});
  return made;
}

}  // namespace slopewise
