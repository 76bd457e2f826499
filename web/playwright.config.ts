import { defineConfig } from "@playwright/test";

export default defineConfig({
  testDir: "test/browser",
  outputDir: "../build/web-test",
  fullyParallel: true,
  workers: 3, // on two processors: most of what they do is to wait
  timeout: 180_000,
  expect: { timeout: 15_000 },
  reporter: "list",
  use: {
    browserName: "chromium",
    launchOptions: {
      executablePath: "/usr/bin/chromium",
      // By that name, unlike by its address, this computer counts as another one.
      args: ["--no-sandbox", "--host-resolver-rules=MAP not-secure.test 127.0.0.1"],
    },
  },
});
