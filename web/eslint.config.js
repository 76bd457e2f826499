import tseslint from "typescript-eslint";

export default tseslint.config(
  { ignores: ["src/generated/", "*.js", "*.mjs", "test-results/"] },
  ...tseslint.configs.strictTypeChecked,
  {
    languageOptions: { parserOptions: { projectService: true } },
    rules: { "@typescript-eslint/restrict-template-expressions": ["error", { allowNumber: true }] },
  },
);
