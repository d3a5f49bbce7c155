// SPDX-License-Identifier: Apache-2.0
// Writes the description of the API from the table of routes and the forms of api/schemas.json.
//
// A form is JSON in a short notation. An object lists its keys; "key?" may be missing. A list has
// the form of its entries. A text names a type: string, integer, number, boolean, object, binary,
// any; the words of an enumeration, "on|off"; or another form by its name, which begins with a
// capital. "integer?" may be null, and the text behind ": " explains the value.
#include <algorithm>

#include "apps/lenticule-web/api/routes.h"
#include "apps/lenticule-web/http/page_files.h"
#include "base/numbers.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

ordered_json schema_of(const ordered_json& form);

ordered_json schema_of_text(std::string_view rest) {
  const size_t colon = rest.find(": ");
  std::string type(rest.substr(0, colon));
  const bool nullable = type.ends_with('?');
  if (nullable) type.pop_back();
  ordered_json schema = ordered_json::object();
  if (type.front() >= 'A' && type.front() <= 'Z') {
    const ordered_json named = {{"$ref", "#/components/schemas/" + type}};
    // Beside a reference nothing else counts.
    if (!nullable && colon == std::string_view::npos) return named;
    schema["allOf"] = ordered_json::array({named});
  } else if (type.find('|') != std::string::npos) {
    schema = {{"type", "string"}, {"enum", ordered_json::array()}};
    for (std::string_view words = type; !words.empty();)
      schema["enum"].push_back(take_until(words, '|'));
  } else if (type == "binary") {
    schema = {{"type", "string"}, {"format", "binary"}};
  } else if (type != "any") {
    schema["type"] = type;
  }
  if (nullable) schema["nullable"] = true;
  if (colon != std::string_view::npos) schema["description"] = rest.substr(colon + 2);
  return schema;
}

ordered_json schema_of(const ordered_json& form) {
  if (form.is_string()) return schema_of_text(form.get_ref<const std::string&>());
  if (form.is_array()) return {{"type", "array"}, {"items", schema_of(form[0])}};
  ordered_json schema = {{"type", "object"}, {"properties", ordered_json::object()}};
  for (const auto& [key, value] : form.items()) {
    const bool optional = key.ends_with('?');
    schema["properties"][optional ? key.substr(0, key.size() - 1) : key] = schema_of(value);
    if (!optional) schema["required"].push_back(key);
  }
  return schema;
}

/// Returns the form in a text of the table.
ordered_json form_of(std::string_view text) {
  return text.starts_with('{') ? ordered_json::parse(text) : ordered_json(text);
}

/// Returns the content of a body or an answer: media types, or a form as JSON.
ordered_json content_of(std::string_view text) {
  if (text.starts_with('{') || text.find('/') == std::string_view::npos)
    return {{"application/json", {{"schema", schema_of(form_of(text))}}}};
  ordered_json content;
  while (!text.empty()) {
    const std::string_view type = take_until(text, ' ');
    content[std::string(type)]["schema"] =
        schema_of(type.starts_with("text/") ? "string" : "binary");
  }
  return content;
}

ordered_json parameters_of(const Route& route) {
  ordered_json parameters = ordered_json::array();
  if (std::string_view(route.path).find("{name}") != std::string_view::npos)
    parameters.push_back(
        {{"name", "name"}, {"in", "path"}, {"required", true}, {"schema", {{"type", "string"}}}});
  if (route.query == nullptr) return parameters;
  const ordered_json query = form_of(route.query);
  for (const auto& [key, form] : query.items()) {
    const bool optional = key.ends_with('?');
    parameters.push_back({{"name", optional ? key.substr(0, key.size() - 1) : key},
                          {"in", "query"},
                          {"required", !optional},
                          {"schema", schema_of(form)}});
  }
  return parameters;
}

ordered_json operation_of(const Route& route) {
  ordered_json operation = {{"summary", route.summary}, {"x-rights", rights_name(route.rights)}};
  if (ordered_json parameters = parameters_of(route); !parameters.empty())
    operation["parameters"] = std::move(parameters);
  if (route.body != nullptr) operation["requestBody"]["content"] = content_of(route.body);
  ordered_json& responses = operation["responses"];
  responses["200"] = {{"description", "success"}, {"content", content_of(route.result)}};
  if (route.second_status != 0) responses[std::to_string(route.second_status)] = responses["200"];
  responses["default"] = {{"$ref", "#/components/responses/Error"}};
  if (route.rights == Rights::None) operation["security"] = ordered_json::array();
  return operation;
}

}  // namespace

ordered_json api_description() {
  ordered_json description = {
      {"openapi", "3.0.3"},
      {"info",
       {{"title", "lenticule web"},
        {"version", "1"},
        {"license",
         {{"name", "Apache-2.0"}, {"url", "https://www.apache.org/licenses/LICENSE-2.0"}}},
        {"description",
         "Pages and an HTTP API for a player. x-rights states whether a token needs the right "
         "'see' or 'change'."}}},
      {"security", {{{"token", ordered_json::array()}}, {{"cookie", ordered_json::array()}}}},
      {"paths", ordered_json::object()},
      {"components",
       {{"securitySchemes",
         {{"token", {{"type", "http"}, {"scheme", "bearer"}}},
          {"cookie", {{"type", "apiKey"}, {"in", "cookie"}, {"name", "lenticule"}}}}},
        {"responses", {{"Error", {{"description", "an error"}, {"content", content_of("Error")}}}}},
        {"schemas", ordered_json::object()}}}};
  for (const Route& route : routes())
    description["paths"][route.path][lower_case(route.method)] = operation_of(route);
  const auto files = page_files();
  const auto file = std::ranges::find(files, std::string_view("schemas.json"), &PageFile::name);
  const ordered_json forms = ordered_json::parse(file->bytes);
  for (const auto& [name, form] : forms.items())
    description["components"]["schemas"][name] = schema_of(form);
  return description;
}

}  // namespace lenticule::web
