// SPDX-License-Identifier: Apache-2.0
#include "scenes/pictured_mesh.h"

#include <cmath>
#include <numbers>

namespace lenticule::scenes {
namespace {

uint32_t append_point(PicturedMesh& mesh, Vec3 position, double u, double v) {
  mesh.positions.push_back(position);
  mesh.uvs.push_back({static_cast<float>(u), static_cast<float>(v)});
  return static_cast<uint32_t>(mesh.positions.size() - 1);
}

}  // namespace

void append_board(PicturedMesh& mesh, const PicturedBoard& board) {
  const auto& [corner, along, across, columns, rows] = board;
  const uint32_t a = append_point(mesh, corner, 0, 0);
  const uint32_t b = append_point(mesh, corner + across, 0, rows);
  const uint32_t c = append_point(mesh, corner + along + across, columns, rows);
  const uint32_t d = append_point(mesh, corner + along, columns, 0);
  mesh.triangles.push_back({a, b, c});
  mesh.triangles.push_back({a, c, d});
}

void append_box(PicturedMesh& mesh, Vec3 low, Vec3 high, double unit) {
  const Vec3 size = high - low;
  const Vec3 x{size.x, 0, 0};
  const Vec3 y{0, size.y, 0};
  const Vec3 z{0, 0, size.z};
  const auto side = [&](Vec3 corner, Vec3 along, Vec3 across) {
    append_board(mesh, {.corner = corner,
                        .along = along,
                        .across = across,
                        .columns = length(along) / unit,
                        .rows = length(across) / unit});
  };
  side(low + z, x, -z);       // front
  side(high, -x, -z);         // back
  side(low + y + z, -y, -z);  // left
  side(low + x + z, y, -z);   // right
  side(low + y + z, x, -y);   // top
  side(low, x, y);            // bottom
}

void append_ball(PicturedMesh& mesh, Vec3 centre, double radius, int cuts) {
  const int about = 2 * cuts;
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (int i = 0; i <= cuts; ++i)
    for (int j = 0; j <= about; ++j) {
      const double down = std::numbers::pi * i / cuts;
      const double turn = 2.0 * std::numbers::pi * (j % about) / about;
      const double ring = i == 0 || i == cuts ? 0.0 : std::sin(down);
      const Vec3 normal{ring * std::cos(turn), ring * std::sin(turn), std::cos(down)};
      append_point(mesh, centre + normal * radius, static_cast<double>(j) / about,
                   static_cast<double>(i) / cuts);
      mesh.normals.push_back(normal);
    }
  const auto point = [&](int i, int j) {
    return first + static_cast<uint32_t>(i * (about + 1) + j);
  };
  for (int i = 0; i < cuts; ++i)
    for (int j = 0; j < about; ++j) {
      if (i + 1 < cuts)
        mesh.triangles.push_back({point(i, j), point(i + 1, j), point(i + 1, j + 1)});
      if (i > 0) mesh.triangles.push_back({point(i, j), point(i + 1, j + 1), point(i, j + 1)});
    }
}

}  // namespace lenticule::scenes
