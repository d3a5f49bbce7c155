// SPDX-License-Identifier: Apache-2.0
#include "display/kms/probe/output_request.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace lenticule::test {

using display::OutputRequest;
using display::parse_kms_spec;

TEST(OutputRequest, ReadsAllFourFormsOfAPanelName) {
  EXPECT_EQ(parse_kms_spec("kms"), OutputRequest{});
  EXPECT_EQ(parse_kms_spec("kms:auto"), OutputRequest{});
  EXPECT_EQ(parse_kms_spec("kms:HDMI-A-1").connector, "HDMI-A-1");
  EXPECT_EQ(parse_kms_spec("kms:/dev/dri/by-path/pci-0000:00:02.0-card").card,
            "/dev/dri/by-path/pci-0000:00:02.0-card");
  const OutputRequest request = parse_kms_spec("kms:edid:LGD:0x5a1:A:B");
  EXPECT_EQ(request.edid.manufacturer, "LGD");
  EXPECT_EQ(request.edid.product, 0x5a1U);
  EXPECT_EQ(request.edid.serial, "A:B");
  EXPECT_EQ(parse_kms_spec("kms:edid:LGD:1441").edid.product, 1441U);
  EXPECT_FALSE(parse_kms_spec("kms:edid:LGD").edid.product);
}

TEST(OutputRequest, ReplacesTheNameAndKeepsTheRest) {
  OutputRequest before{.connector = "DP-1", .card = "/dev/dri/card0", .panel = {64, 32}};
  before.edid.manufacturer = "DEL";
  before.identity.serial = "42";
  OutputRequest expected{.connector = "HDMI-A-1", .panel = {64, 32}};
  expected.identity.serial = "42";
  EXPECT_EQ(parse_kms_spec("kms:HDMI-A-1", before), expected);
  expected.connector.clear();
  EXPECT_EQ(parse_kms_spec("kms", before), expected);
}

TEST(OutputRequest, RefusesEverythingElse) {
  for (const char* spec :
       {"kmsx", "kms:HDMI", "kms:edid:", "kms:edid:lgd", "kms:edid:LG", "kms:edid:LGD:70000",
        "kms:edid:LGD:0x", "kms:edid:LGD:-1", "kms:a b-1", "virtual"}) {
    EXPECT_THROW((void)parse_kms_spec(spec), Error) << spec;
  }
}

}  // namespace lenticule::test
