// SPDX-License-Identifier: Apache-2.0
// Tests that pairs of two eyes' pictures are found by their pixels, and nothing else is taken for
// one. All pictures are drawn here. The table of results is printed.
#include "frames/views_input/stereo_pair.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace lenticule::frames {
namespace {

/// Texture has the spectrum of photographs (1/f) and repeats after 1024 pixels.
class Texture {
 public:
  Texture() : values_(size_t{kSide} * kSide) {
    std::mt19937 random(1);
    for (int cell = 256; cell >= 2; cell /= 2) {
      const int cells = kSide / cell;
      std::vector<float> corners(static_cast<size_t>(cells * cells));
      for (float& corner : corners)
        corner = std::uniform_real_distribution<float>(-1, 1)(random) * std::pow(float(cell), 0.7F);
      const auto corner = [&](int x, int y) {
        return corners[static_cast<size_t>((y % cells) * cells + x % cells)];
      };
      for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
          const int i = x / cell, j = y / cell;
          const float u = float(x % cell) / float(cell), v = float(y % cell) / float(cell);
          values_[static_cast<size_t>(y * kSide + x)] +=
              (corner(i, j) * (1 - u) + corner(i + 1, j) * u) * (1 - v) +
              (corner(i, j + 1) * (1 - u) + corner(i + 1, j + 1) * u) * v;
        }
    }
  }

  /// Returns a value whose mean is 0 and whose spread is some 40 codes.
  [[nodiscard]] double at(double x, double y) const {
    const double i = std::floor(x), j = std::floor(y), u = x - i, v = y - j;
    const auto value = [&](double a, double b) {
      const auto column = static_cast<size_t>(static_cast<int64_t>(a) & (kSide - 1));
      const auto row = static_cast<size_t>(static_cast<int64_t>(b) & (kSide - 1));
      return double{values_[row * kSide + column]};
    };
    return (value(i, j) * (1 - u) + value(i + 1, j) * u) * (1 - v) +
           (value(i, j + 1) * (1 - u) + value(i + 1, j + 1) * u) * v;
  }

 private:
  static constexpr int kSide = 1024;
  std::vector<float> values_;
};

/// Random draws what differs from picture to picture.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  int whole(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  double noise(double spread) { return std::normal_distribution<double>(0, spread)(engine_); }
  bool chance() { return whole(0, 1) == 1; }

 private:
  std::mt19937 engine_;
};

using Shade = std::function<double(double x, double y)>;

WovenFrame drawn(int width, int height, const Shade& shade) {
  WovenFrame picture({.width = width, .height = height});
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      std::fill_n(picture.row(y) + 3 * x, 3,
                  static_cast<uint8_t>(std::clamp(shade(x, y), 0.0, 255.0)));
  return picture;
}

const Texture& texture() {
  static const Texture made;
  return made;
}

Shade photograph(Random& random) {
  const double x0 = random.between(0, 1000), y0 = random.between(0, 1000);
  const double angle = random.between(0, 6.283), c = std::cos(angle), s = std::sin(angle);
  const double contrast = random.between(0.6, 1.6), mean = random.between(90, 160);
  return [=](double x, double y) {
    return mean + contrast * texture().at(x0 + c * x - s * y, y0 + s * x + c * y);
  };
}

/// Scene has objects at several distances before a wall, and a floor that comes nearer.
class Scene {
 public:
  /// `nearest` and `farthest` are disparities in pixels.
  Scene(Random& random, double width, double height, double farthest, double nearest)
      : height_(height), farthest_(farthest), nearest_(nearest) {
    wall_ = photograph(random);
    floor_ = photograph(random);
    horizon_ = random.between(0.4, 0.9) * height;
    for (int n = random.whole(3, 9), i = 1; i <= n; ++i)
      objects_.push_back({.surface = photograph(random),
                          .x = random.between(0, width),
                          .y = random.between(0.1, 0.9) * height,
                          .across = random.between(0.04, 0.16) * width,
                          .down = random.between(0.08, 0.35) * height,
                          .disparity = farthest + (nearest - farthest) * i / n,
                          .round = random.chance()});
  }

  /// Returns what is seen from -1/2 (left eye) to 1/2 (right eye).
  [[nodiscard]] double seen(double x, double y, double from) const {
    for (size_t i = objects_.size(); i-- > 0;) {
      const Object& o = objects_[i];
      const double own = x + o.disparity * from, u = (own - o.x) / o.across, v = (y - o.y) / o.down;
      if (o.round ? u * u + v * v < 1 : std::abs(u) < 1 && std::abs(v) < 1)
        return o.surface(own, y);
    }
    if (y < horizon_) return wall_(x + farthest_ * from, y);
    const double near = (y - horizon_) / (height_ - horizon_);
    return floor_(x + (farthest_ + (nearest_ - farthest_) * near) * from, y);
  }

 private:
  struct Object {
    Shade surface;
    double x, y, across, down, disparity;
    bool round;
  };
  double height_, farthest_, nearest_, horizon_ = 0;
  Shade wall_, floor_;
  std::vector<Object> objects_;
};

/// Returns a text-like pattern: words of marks in lines.
Shade text(Random& random) {
  const int line = random.whole(9, 24), seed = random.whole(0, 1000);
  return [=](double x, double y) {
    const int row = int(y) / line, glyph = int(x) * 5 / (line * 2);
    if (int(y) % line > line * 2 / 3) return 245.0;
    const auto mark = [&](int a, int b) {
      return std::minstd_rand(static_cast<unsigned>(seed + a * 7919 + b * 104729))() % 97;
    };
    if (mark(glyph, row) < 16) return 245.0;  // between words
    return mark(glyph * 31 + int(x) % (line * 2 / 5) / 2, row * 17 + int(y) % line / 2) < 48
               ? 30.0
               : 245.0;
  };
}

/// Returns copies of one picture, whose columns repeat after `period`.
Shade tiles(const Shade& tile, double across, double down) {
  return [=](double x, double y) { return tile(std::fmod(x, across), std::fmod(y, down)); };
}

using Draw = std::function<WovenFrame(Random&)>;

/// Kinds of pictures for both eyes. They have 480 x 270 pixels unless their kind needs others.
std::map<std::string, Draw> flat_pictures() {
  constexpr int kW = 480, kH = 270;
  const auto of = [](const std::function<Shade(Random&)>& make) -> Draw {
    return [=](Random& random) { return drawn(kW, kH, make(random)); };
  };
  std::map<std::string, Draw> kinds;
  kinds["gradient"] = of([](Random& r) -> Shade {
    const double a = r.between(-0.4, 0.4), b = r.between(-0.4, 0.4);
    return [=](double x, double y) { return 128 + a * (x - 240) + b * (y - 135); };
  });
  kinds["round gradient"] = of([](Random& r) -> Shade {
    const double cx = r.between(0, kW), cy = r.between(0, kH), k = r.between(0.3, 3);
    return [=](double x, double y) { return 255 - k * std::hypot(x - cx, y - cy); };
  });
  kinds["white noise"] = of([](Random& r) -> Shade {
    const double spread = r.between(5, 80);
    return [=, &r](double, double) { return 128 + r.noise(spread); };
  });
  kinds["photograph"] = of(photograph);
  kinds["scene"] = of([](Random& r) -> Shade {
    return [scene = Scene(r, kW, kH, 0, 0)](double x, double y) { return scene.seen(x, y, 0); };
  });
  kinds["grating"] = of([](Random& r) -> Shade {
    const double a = r.between(-1, 1), b = r.between(-1, 1);
    return [=](double x, double y) { return 128 + 90 * std::sin(a * x + b * y); };
  });
  kinds["chequers"] = of([](Random& r) -> Shade {
    const int side = r.whole(4, 70);
    return [=](double x, double y) { return (int(x) / side + int(y) / side) % 2 * 200.0 + 20; };
  });
  kinds["plaid"] = of([](Random& r) -> Shade {
    std::array<double, 8> k{};
    for (double& one : k) one = r.between(0.02, 0.7);
    return [=](double x, double y) {
      double sum = 128;
      for (size_t i = 0; i < k.size(); i += 2)
        sum += 25 * std::sin(k[i] * x) * std::cos(k[i + 1] * y);
      return sum;
    };
  });
  kinds["tiles"] = of([](Random& r) -> Shade {
    const double across = r.whole(20, 250), down = r.whole(20, 200);
    return tiles(photograph(r), across, down);
  });
  kinds["tiles that divide the width"] = of([](Random& r) -> Shade {
    const int n = 2 << r.whole(0, 3);
    return tiles(photograph(r), double(kW) / n, double(kH) / (1 << r.whole(0, 2)));
  });
  kinds["noisy tiles"] = of([](Random& r) -> Shade {
    const Shade tile = tiles(photograph(r), r.whole(40, 250), r.whole(40, 200));
    return [=, &r](double x, double y) { return tile(x, y) + r.noise(6); };
  });
  kinds["text"] = of(text);
  kinds["two columns of text"] = of([](Random& r) -> Shade {
    return [=, words = text(r)](double x, double y) {
      const double column = std::fmod(x, 240.0);
      return column < 20 || column > 220 || y < 15 || y > 255 ? 245.0 : words(x, y);
    };
  });
  kinds["mirrored left to right"] = of([](Random& r) -> Shade {
    return [tile = photograph(r)](double x, double y) { return tile(std::abs(x - 239.5), y); };
  });
  kinds["mirrored top to bottom"] = of([](Random& r) -> Shade {
    return [tile = photograph(r)](double x, double y) { return tile(x, std::abs(y - 134.5)); };
  });
  kinds["kaleidoscope"] = of([](Random& r) -> Shade {
    return [tile = photograph(r)](double x, double y) {
      return tile(std::abs(x - 239.5), std::abs(y - 134.5));
    };
  });
  kinds["bricks"] = of([](Random& r) -> Shade {
    const int w = r.whole(16, 60), h = r.whole(8, 30);
    return [=, wall = photograph(r)](double x, double y) {
      const bool odd = int(y) / h % 2 == 1;
      const bool joint = int(y) % h < 2 || (int(x) + (odd ? w / 2 : 0)) % w < 2;
      return joint ? 220.0 : 0.3 * wall(x, y) + 60;
    };
  });
  kinds["floor in perspective"] = of([](Random& r) -> Shade {
    const double horizon = r.between(-40, 100), k = r.between(300, 3000), turn = r.between(-1, 1);
    return [=](double x, double y) {
      if (y <= horizon + 2) return 200.0;
      const double z = k / (y - horizon), across = (x - 240) * z / 100 + turn * z;
      return (int(std::floor(across)) + int(std::floor(z))) % 2 == 0 ? 40.0 : 210.0;
    };
  });
  kinds["zone plate"] = of([](Random& r) -> Shade {
    const double cx = r.between(100, 380), cy = r.between(50, 220), k = r.between(0.002, 0.02);
    return [=](double x, double y) {
      return 128 + 100 * std::cos(k * ((x - cx) * (x - cx) + (y - cy) * (y - cy)));
    };
  });
  kinds["fence in perspective"] = of([](Random& r) -> Shade {
    const double first = r.between(4, 12), growth = r.between(1.01, 1.12);
    return [=, wall = photograph(r)](double x, double y) {
      const double n = std::log(1 + x * (growth - 1) / first) / std::log(growth);
      return n - std::floor(n) < 0.4 ? 60 + 0.2 * wall(n * 37, y) : wall(x, y);
    };
  });
  kinds["quilt"] = [](Random& r) {
    const int columns = r.whole(2, 8), rows = r.whole(2, 8);
    const double w = 640 / columns, h = 480 / rows;
    const Scene scene(r, w, h, -0.06 * w, 0.06 * w);
    return drawn(columns * int(w), rows * int(h), [&](double x, double y) {
      const int view = int(y / h) * columns + int(x / w);
      return scene.seen(std::fmod(x, w), std::fmod(y, h), view / (columns * rows - 1.0) - 0.5);
    });
  };
  kinds["row of views"] = [](Random& r) {
    const int views = r.whole(3, 8);
    const double w = 160;
    const Scene scene(r, w, 120, -8, 8);
    return drawn(views * int(w), 120, [&](double x, double y) {
      return scene.seen(std::fmod(x, w), y, int(x / w) / (views - 1.0) - 0.5);
    });
  };
  kinds["rows of equal signs"] = of([](Random& r) -> Shade {
    const int pitch = r.whole(30, 90), jitter = r.whole(0, pitch / 4);
    std::vector<int> moved(400);
    for (int& one : moved) one = r.whole(-jitter, jitter);
    return [=, sign = photograph(r)](double x, double y) {
      const int column = int(x) / pitch, row = int(y) / pitch;
      const double u = std::fmod(x, pitch) - moved[static_cast<size_t>(row * 20 + column)];
      const double v = std::fmod(y, pitch);
      const bool inside =
          u > pitch * 0.25 && u < pitch * 0.75 && v > pitch * 0.2 && v < pitch * 0.8;
      return inside ? sign(u, v) : 240.0;
    };
  });
  kinds["before and after"] = of([](Random& r) -> Shade {
    const Shade one = photograph(r);
    const double moved = r.between(-6, 6), brighter = r.between(0.7, 1.3);
    return [=, &r](double x, double y) {
      return x < 240 ? one(x, y) : brighter * one(x - 240 + moved, y) + r.noise(3);
    };
  });
  kinds["colour and depth"] = of([](Random& r) -> Shade {
    const auto scene = std::make_shared<Scene>(Scene(r, 240, kH, 0, 0));
    return [=, depth = photograph(r)](double x, double y) {
      return x < 240 ? scene->seen(x, y, 0)
                     : 128 + 0.5 * (scene->seen(x - 240, y, 0) - 128) + 0.1 * depth(x / 9, y / 9);
    };
  });
  kinds["two photographs"] = of([](Random& r) -> Shade {
    return [a = photograph(r), b = photograph(r)](double x, double y) {
      return x < 240 ? a(x, y) : b(x, y);
    };
  });
  kinds["comic"] = of([](Random& r) -> Shade {
    std::vector<Shade> panels;
    for (int i = 0; i < 6; ++i) panels.push_back(photograph(r));
    return [=](double x, double y) {
      if (std::fmod(x, 160) < 8 || std::fmod(y, 135) < 8) return 250.0;
      return panels[static_cast<size_t>(int(y / 135) * 3 + int(x / 160))](x, y);
    };
  });
  kinds["slide"] = of([](Random& r) -> Shade {
    return [words = text(r), a = photograph(r)](double x, double y) {
      if (x > 20 && x < 220 && y > 80 && y < 240) return a(x, y);
      return (x > 250 && x < 460 && y > 80) || (y > 20 && y < 50 && x > 60) ? words(x, y) : 245.0;
    };
  });
  return kinds;
}

/// Draws a pair: beside or above each other, squeezed or not, with noise, at different brightness
/// and slightly different height.
WovenFrame pair(Random& r, bool beside, bool half) {
  const int across = r.whole(300, 420), down = across * r.whole(50, 75) / 100;
  const double spread = r.between(0.012, 0.06) * across, middle = r.between(-0.02, 0.02) * across;
  const Scene scene(r, across, down, middle - spread / 2, middle + spread / 2);
  const double noise = r.between(0, 2.5), brighter = r.between(0.9, 1.1);
  const double lower = r.between(-0.003, 0.003) * across;
  const int w = beside && half ? across / 2 : across, h = !beside && half ? down / 2 : down;
  return drawn(beside ? 2 * w : w, beside ? h : 2 * h, [&](double x, double y) {
    const bool second = beside ? x >= w : y >= h;
    const double u = (beside && second ? x - w : x) * across / w;
    const double v = (!beside && second ? y - h : y) * down / h;
    const double light = second ? brighter * scene.seen(u, v + lower, 0.5) : scene.seen(u, v, -0.5);
    return light + r.noise(noise);
  });
}

TEST(StereoPair, NoOtherPictureIsTakenForAPair) {
  constexpr unsigned kOfEach = 20;
  const auto kinds = flat_pictures();
  EXPECT_GE(kinds.size() * kOfEach, 500U);
  for (const auto& [kind, draw] : kinds) {
    unsigned wrong = 0;
    for (unsigned seed = 0; seed < kOfEach; ++seed) {
      Random random(1000 + seed);
      wrong += find_stereo_pair(draw(random).view()) ? 1 : 0;
    }
    fmt::print("{:30} {:3} of {} taken for a pair\n", kind, wrong, kOfEach);
    EXPECT_EQ(wrong, 0U) << kind;
  }
}

TEST(StereoPair, MostPairsAreFoundWithTheirLayout) {
  constexpr unsigned kOfEach = 65;
  unsigned all = 0;
  for (const bool beside : {true, false})
    for (const bool half : {false, true}) {
      unsigned found = 0;
      for (unsigned seed = 0; seed < kOfEach; ++seed) {
        Random random(5000 + seed);
        const WovenFrame picture = pair(random, beside, half);
        const auto is = find_stereo_pair(picture.view());
        if (!is) continue;
        ++found;
        EXPECT_EQ(is->layout.beside, beside);
        EXPECT_FALSE(is->layout.right_first);
        EXPECT_LT(is->back, is->front);
      }
      fmt::print("{:15} {:9} {:3} of {} found\n", beside ? "side by side" : "above each other",
                 half ? "squeezed" : "full", found, kOfEach);
      all += found;
    }
  EXPECT_GE(all, 4 * kOfEach * 8 / 10);
}

TEST(StereoPair, PicturesWithTheShapeOfAFilmAreSqueezedAndTheNearSideIsInFront) {
  Random random(1);
  const Scene scene(random, 640, 360, -20, 10);
  const WovenFrame squeezed = drawn(640, 360, [&](double x, double y) {
    return scene.seen(std::fmod(x, 320) * 2, y, x < 320 ? -0.5 : 0.5);
  });
  const auto found = find_stereo_pair(squeezed.view());
  ASSERT_TRUE(found);
  EXPECT_EQ(found->layout, (StereoLayout{.beside = true, .half = true}));
  EXPECT_NEAR(found->back, -20.0 / 640, 0.008);
  EXPECT_NEAR(found->front, 10.0 / 640, 0.02);
  EXPECT_GT(found->matching, 0.6);
}

}  // namespace
}  // namespace lenticule::frames
