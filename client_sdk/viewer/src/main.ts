import {protocolVersion} from '@stridewire/client';

console.log(protocolVersion);
