// What the tests use of the package that esptool-js brings.
declare module "pako" {
  export class Inflate {
    onData: (data: Uint8Array) => void;
    push(data: Uint8Array, flush: number): boolean;
  }
}
