import { defineConfig } from "vitest/config";

// The limit is one that only a defect reaches, on a busy computer, too.
export default defineConfig({ test: { include: ["test/*.test.ts"], testTimeout: 120_000, maxWorkers: 2 } });
