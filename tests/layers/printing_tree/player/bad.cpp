// SPDX-License-Identifier: Apache-2.0
void print_past_base() {
  fmt::print("result\n");
  std::cerr << "a log line";
  std::fputs("a log line", stderr);
  std::printf("a result");
  perror("a log line");
}
