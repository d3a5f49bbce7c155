// SPDX-License-Identifier: Apache-2.0
#include "render/shading/pbr_tables.h"

#include <algorithm>

#include "render/shading/pbr_brdf.h"
#include "render/shading/shading_tables.h"

namespace lenticule::render {
namespace {

void write(Vec3 v, float (&out)[3]) {
  out[0] = static_cast<float>(v.x);
  out[1] = static_cast<float>(v.y);
  out[2] = static_cast<float>(v.z);
}

/// Returns true if the material consists of a base, a mirror and at most a coat.
bool is_plain(const PbrMaterial& m) {
  return !m.unlit && m.transmission == 0.0 && m.sheen_colour == Vec3{} && m.iridescence == 0.0 &&
         m.anisotropy == 0.0;
}

/// Textures also decide where a material is cut out.
bool is_textured(const PbrMaterial& m) {
  const TextureUse* uses[] = {
      &m.base_colour_texture,     &m.metallic_roughness_texture, &m.normal_texture,
      &m.occlusion_texture,       &m.emission_texture,           &m.specular_texture,
      &m.specular_colour_texture, &m.clearcoat_texture,          &m.clearcoat_roughness_texture,
      &m.clearcoat_normal_texture};
  return m.alpha_mode != PbrMaterial::AlphaMode::Opaque ||
         std::ranges::any_of(uses, [](const TextureUse* use) { return use->texture >= 0; });
}

pbr_kernel::Material table_entry(const PbrMaterial& m) {
  pbr_kernel::Material out{};
  write(m.base_colour, out.colour);
  write(m.emission, out.emission);
  out.metallic = static_cast<float>(std::clamp(m.metallic, 0.0, 1.0));
  out.roughness = static_cast<float>(std::clamp(m.roughness, 0.0, 1.0));
  write(dielectric_f0(m.ior, m.specular, m.specular_colour), out.f0);
  out.f90 = static_cast<float>(m.specular);
  out.coat = static_cast<float>(m.clearcoat);
  out.coat_roughness = static_cast<float>(std::clamp(m.clearcoat_roughness, 0.0, 1.0));
  out.is_plain = is_plain(m) ? -1 : 0;
  out.is_two_sided = m.double_sided ? -1 : 0;
  out.is_textured = is_textured(m) ? -1 : 0;
  return out;
}

}  // namespace

PbrTables::PbrTables(const Scene& scene, const EnvironmentLight& light,
                     const PbrShader::Frame& axes) {
  for (const Material& material : scene.materials) {
    materials_.push_back(table_entry(*material.pbr));
    any_plain_ = any_plain_ || materials_.back().is_plain != 0;
  }
  for (const MeshShape& mesh : scene.meshes)
    if (!mesh.colours.empty()) materials_[static_cast<size_t>(mesh.material)].is_textured = -1;
  tables_ = {.shapes = &scene.shading->tables(),
             .materials = materials_.data(),
             .environment = light.tables(),
             .albedo = &ggx_albedo_table()};
  write(axes.right, tables_.environment.right);
  write(axes.up, tables_.environment.up);
  write(axes.back, tables_.environment.back);

  const Affine panel_from_scene = scene.scene_from_panel.inverse();
  write(scene.scene_from_panel.column_x, axes_.across);
  write(scene.scene_from_panel.column_y, axes_.along);
  write({panel_from_scene.column_x.z, panel_from_scene.column_y.z, panel_from_scene.column_z.z},
        axes_.depth);
  axes_.depth_origin = static_cast<float>(panel_from_scene.origin.z);
}

pbr_kernel::Beam PbrTables::beam(const BeamSize& size) const {
  pbr_kernel::Beam beam = axes_;
  beam.lens_mm = static_cast<float>(size.lens_mm);
  beam.row_mm = static_cast<float>(size.row_mm);
  beam.subpixels_per_gap = static_cast<float>(size.subpixels_per_gap);
  beam.inverse_distance = static_cast<float>(size.inverse_distance);
  return beam;
}

const pbr_kernel::Kernel& pbr_kernel_for(Isa isa) {
  return LENTICULE_SELECT_KERNEL(isa, kPbrKernel);
}

}  // namespace lenticule::render
